"""Control steps: compiled or not the same numbers, and results are the user's own."""

import numpy as np
import pytest

import marl_airhockey as ah

GAMES = [
    ("juggle", {}),
    ("juggle", {"profile": "ur5e"}),
    ("hit_goal", {"goals": "dict"}),
    ("move_block", {"physics": {"tilt": (3.0, 8.0)}}),
    ("duel", {}),
    ("free_for_all", {}),
]


def play(world, steps):
    """Everything that steps give, in the order of their making."""
    rng, seen = np.random.default_rng(0), [world.reset(3)]
    for k in range(steps):
        if k == steps // 2:
            seen.append(world.reset())
        step = world.step(
            rng.uniform(-1.3, 1.3, (len(world.seeds), len(world.open), 2))
        )
        seen += [step.observation, step.reward, step.terms, step.terminated]
        seen += [
            step.truncated,
            step.applied_action,
            step.violation,
            step.success,
            step.first_shot,
        ]
        seen += [world.state.position.copy(), world.state.touched_at.copy()]
        seen += [{k: v.copy() for k, v in world.memory.items()}]
        seen += [world.episode.returns.copy(), world.command.copy()]
    return seen


@pytest.mark.parametrize("worlds", [1, 5])
@pytest.mark.parametrize(("game", "keywords"), GAMES)
def test_compiled_or_not_a_step_is_the_same(
    game, keywords, backend, worlds, monkeypatch
):
    runs = []
    for compiled in "10":
        monkeypatch.setenv("MARL_AIRHOCKEY_COMPILE", compiled)
        world = ah.make_world(game, worlds, backend=backend, max_cycles=90, **keywords)
        runs.append(play(world, 120))
        world.close()
    for one, two in zip(*runs, strict=True):
        compare(one, two)


def compare(one, two):
    """The loop's exp and numpy's differ in the last digit; all else is the same."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for name, value in one.items():
            compare(value, two[name])
        return
    np.testing.assert_allclose(one, two, 1e-6 if one.dtype == "f4" else 1e-12, 1e-12)


def test_what_a_step_gives_is_the_users_own():
    world = ah.make_world("juggle", 3, backend="numba")
    world.reset(0)
    steps, kept, worlds, copies = [], [], [], []
    for k in range(80):
        step = world.step(np.full((3, 1, 2), np.sin(k)))
        now = [world.state.position, world.memory["hits"], world.episode.cycles]
        worlds.append([*now, world.command, world.sensed.velocity])
        copies.append([array.copy() for array in worlds[-1]])
        steps.append(step)
        kept.append([step.observation.copy(), step.reward.copy(), step.success.copy()])
        kept[-1] += [
            step.applied_action.copy(),
            step.violation.copy(),
            step.terms["hit"].copy(),
        ]
    for step, old in zip(steps, kept, strict=True):
        now = [
            step.observation,
            step.reward,
            step.success,
            step.applied_action,
            step.violation,
        ]
        np.testing.assert_equal([*now, step.terms["hit"]], old)
    np.testing.assert_equal(worlds, copies)


def test_an_action_that_is_not_finite_moves_nothing():
    world = ah.make_world("juggle", 3, backend="numba")
    world.reset(0)
    actions = np.zeros((3, 1, 2))
    for _ in range(60):
        world.step(actions)
    before = world.state.position.copy()
    bad = actions.copy()
    bad[1] = np.nan
    with pytest.raises(ValueError, match="finite"):
        world.step(bad)
    np.testing.assert_array_equal(world.state.position, before)
    world.step(actions)
