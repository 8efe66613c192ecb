"""Open and driven seats as PettingZoo sees them."""

import importlib

import gymnasium
import numpy as np
import pettingzoo
import pytest
from pair import Pair
from pettingzoo.test import max_cycles_test, parallel_api_test

import marl_airhockey as ah
from marl_airhockey.discovery import pettingzoo_id


def test_two_open_seats_pass_pettingzoos_test():
    parallel_api_test(ah.parallel_env(Pair()), num_cycles=400)


@pytest.mark.parametrize("kind", ["parallel", "aec"])
def test_every_scenario_is_in_pettingzoos_registry(kind):
    known = getattr(pettingzoo, f"{kind}_registry")
    ours = {spec.name for spec in known.values() if spec.namespace == "marl_airhockey"}
    assert ours == set(ah.scenario_names())
    for name in ours:
        env = pettingzoo.make(kind, pettingzoo_id(name))
        assert env.metadata["name"] == f"{name}_v{ah.make_scenario(name).version}"


def test_keywords_pass_through_pettingzoos_registry():
    drivers = {"paddle_1": "striker"}
    env = pettingzoo.make("parallel", "marl_airhockey/duel", drivers=drivers)
    assert env.possible_agents == ["paddle_0"]
    with pytest.raises(ValueError, match="unknown"):
        pettingzoo.make("aec", "marl_airhockey/duel-v1", driver=drivers)


def test_a_driven_seat_makes_it_a_single_agent_environment():
    env = ah.parallel_env(Pair(), drivers={"paddle_0": "goalkeeper"})
    env.reset(seed=0)
    assert env.agents == ["paddle_1"]
    assert env.teams == {0: ["paddle_0"], 1: ["paddle_1"]}
    assert env.group_map == {"team_1": ["paddle_1"]}
    vec = ah.make_vec(Pair(), 4, drivers={"paddle_0": "random"})
    seen, _ = vec.reset(seed=0)
    assert seen.shape == (4, len(env.observation_labels("paddle_1")))
    with pytest.raises(ValueError, match="needs exactly one"):
        ah.make_vec(Pair(), 4)
    hint = r'drivers={"paddle_1": "still", "paddle_2": "still", "paddle_3": "still"}'
    with pytest.raises(ValueError, match=hint):
        ah.gym_env("doubles")


def test_every_number_of_state_and_observation_has_a_name():
    env = ah.parallel_env("duel")
    env.reset(seed=0)
    named = dict(zip(env.state_labels, env.state(), strict=True))
    state, _ = env.get_state()
    assert named["puck_0.vx"] == pytest.approx(state.puck_velocity[0, 0])
    assert named["paddle_1.y"] == pytest.approx(state.paddle[1, 1])
    assert named["puck_0.spin"] == pytest.approx(state.puck_edge[0])
    labels = env.observation_labels("paddle_0")
    assert ah.make_sb3_vec("duel", 2).observation_labels == labels
    single, many = ah.parallel_env("reach"), ah.make_vec("reach", 2)
    task = gymnasium.make("marl_airhockey/Reach-v1").unwrapped
    own = single.observation_labels("paddle_0")
    assert many.observation_labels == task.observation_labels == own
    assert len(own) == task.observation_space.shape[0]


@pytest.mark.parametrize("name", ["free_for_all", "hit_goal", "move_block", "rally"])
def test_the_state_holds_what_the_scenario_remembers(name):
    env = ah.parallel_env(name)
    env.reset(seed=0)
    shown = []
    for _ in range(40):
        env.step({a: env.action_space(a).sample() for a in env.agents})
        shown.append(env.state())
        assert env.state_space.contains(shown[-1])
    named = dict(zip(env.state_labels, shown[-1], strict=True))
    for key, array in env.get_state()[1].items():
        places = ["_".join(map(str, (key, *i))) for i in np.ndindex(array.shape)]
        kept = np.clip(array.astype(np.float32).ravel(), -10, 10)
        assert [named[place] for place in places] == kept.tolist()


def test_games_are_imported_as_those_of_pettingzoo():
    from marl_airhockey import duel_v1

    assert duel_v1.parallel_env(max_cycles=7).max_cycles == 7
    max_cycles_test(duel_v1)
    with pytest.raises(ImportError, match="contains duel_v1"):
        from marl_airhockey import duel_v7  # noqa: F401
    rally = importlib.import_module("marl_airhockey.rally_v0")
    assert rally.parallel_env().possible_agents == ["paddle_0", "paddle_1"]
    for wrong in ("marl_airhockey.dule_v0", "marl_airhockey.nothing"):
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module(wrong)
    with pytest.raises(ImportError, match="contains duel_v1"):
        importlib.import_module("marl_airhockey.duel_v3")
    assert not hasattr(ah, "duell_v0")
