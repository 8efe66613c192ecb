"""Marks, captions and results: the same for a batch and for each of its worlds."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.registry import scenario_names
from marl_airhockey.sim.contracts.mark import Caption


@pytest.mark.parametrize("name", scenario_names())
def test_display_of_a_batch_has_the_values_of_each_world(name):
    world = ah.make_world(name, 3)
    world.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(60):
        world.step(rng.uniform(-1.0, 1.0, (3, len(world.open), 2)))
    scenario = world.scenario
    arrays = scenario.display_arrays(world.state, world.memory)
    for k in range(3):
        state = world.state.map(lambda x, k=k: x[k])
        memory = {key: value[k] for key, value in world.memory.items()}
        found = arrays.get("marks", np.zeros((3, 0, 6)))[k]
        shown = [mark.numbers for mark in scenario.shown_marks(state, memory)]
        assert found[found[:, 5] > 0.0, :5].tolist() == [list(row) for row in shown]
        caption = scenario.caption(memory)
        assert arrays["caption"][k].tolist() == [float(n) for n in caption.numbers]
        assert caption.text.count("{") == len(caption.numbers)
        rules = list(scenario.deciders(memory))
        decides = arrays.get("deciders", np.zeros((3, 0)))[k]
        first = [rule for rule, yes in zip(rules, decides, strict=True) if yes]
        assert scenario.decided_by(memory) == (first[0] if first else "")
        for key, counts in scenario.scores(memory).items():
            assert arrays[f"scores.{key}"][k].tolist() == counts.tolist()


def test_unknown_numbers_of_a_caption_are_dashes():
    caption = Caption("closest {:.0f} cm, needs {:.1f} cm", np.array(np.inf), 2.04)
    assert str(caption) == "closest - cm, needs 2.0 cm"
