"""What observables show: vectors between bodies are differences of their positions."""

import numpy as np
import pytest

import marl_airhockey as ah


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("name", ["juggle", "move_block", "duel", "free_for_all"])
def test_vectors_to_bodies_are_differences_of_their_positions(name):
    world = ah.make_world(name, 4)
    world.reset(0)
    labels = world.observer.layout.labels
    # With a reaction, vectors are to pucks as they are predicted.
    late = ".predicted" if "puck_0.predicted.x" in labels else ""
    rng, compared = np.random.default_rng(0), 0
    for _ in range(20):
        actions = rng.uniform(-1, 1, (4, len(world.open), 2))
        seen = world.step(actions).observation

        def value(label, seen=seen):
            return seen[..., labels.index(label)]

        for label in labels:
            start, _, rest = label.partition("_to_")
            body, _, axis = rest.partition(".d")
            if start == "own" and body.startswith("puck"):
                gap = value(f"{body}{late}.{axis}") - value(f"own.{axis}")
                np.testing.assert_allclose(value(label), gap, atol=1e-5)
                compared += 1
    assert compared >= 40
