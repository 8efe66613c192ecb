"""Copies of everything that steps: independent twins, which go on to the same bit."""

import copy
import pickle
import subprocess
import sys

import cloudpickle
import numpy as np
import pytest

import marl_airhockey as ah

LAST = 60
MOMENTS = [LAST, *(pytest.param(steps, marks=pytest.mark.slow) for steps in (0, 1))]
"""Numbers of steps after which copies are made"""
GAMES = [
    ("juggle", {}),
    ("juggle", {"profile": "ur5e"}),
    ("juggle", {"observe": "pixels"}),
    ("juggle", {"observe": "camera"}),
    ("hit_goal", {"goals": "dict"}),
    ("strike_crowd", {}),
    ("duel", {"drivers": {"paddle_1": "zoo/duel"}}),
    ("free_for_all", {}),
]
GO_ON = """
import pickle, sys
with open(sys.argv[1], "rb") as file:
    world, actions = pickle.load(file)
seen = []
for action in actions:
    step = world.step(action)
    seen += [step.observation, step.reward, world.state.position, step.cost]
with open(sys.argv[2], "wb") as file:
    pickle.dump(seen, file)
"""


def actions(world, steps, seed):
    rng = np.random.default_rng(seed)
    shape = (steps, world.num_worlds, len(world.open), 2)
    return rng.uniform(-1.2, 1.2, shape)


def play(world, given):
    seen = []
    for action in given:
        step = world.step(action)
        seen += [step.observation, step.reward, world.state.position, step.cost]
    return seen


def check_twins(world, steps, folder):
    """Copies made after some steps go on to the same bit, and by themselves."""
    world.reset(3)
    play(world, actions(world, steps, 1))
    given = actions(world, 30, 2)
    twins = [
        copy.deepcopy(world),
        pickle.loads(pickle.dumps(world)),
        cloudpickle.loads(cloudpickle.dumps(world)),
    ]
    sleeper = copy.deepcopy(world)
    with open(folder / "world", "wb") as file:
        pickle.dump((world, given), file)
    # The copy first: what it does must not move the original, nor the other way round.
    first = play(twins[0], given)
    np.testing.assert_equal(play(world, given), first)
    for twin in twins[1:]:
        np.testing.assert_equal(play(twin, given), first)
    del world, twins
    np.testing.assert_equal(play(sleeper, given), first)
    return first


def check_another_process(first, folder):
    """The world that was pickled goes on in another process to the same bit."""
    files = str(folder / "world"), str(folder / "seen")
    subprocess.run([sys.executable, "-c", GO_ON, *files], check=True)
    with open(files[1], "rb") as file:
        np.testing.assert_equal(pickle.load(file), first)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("steps", MOMENTS)
@pytest.mark.parametrize(("game", "keywords"), GAMES)
def test_copies_of_worlds_go_on_to_the_same_bit(
    game, keywords, backend, steps, tmp_path
):
    world = ah.make_world(game, 2, backend=backend, **keywords)
    first = check_twins(world, steps, tmp_path)
    if steps == LAST and not keywords:
        check_another_process(first, tmp_path)


@pytest.mark.parametrize("steps", MOMENTS)
def test_copies_of_arms_go_on_to_the_same_bit(steps, tmp_path):
    pytest.importorskip("robosuite")
    physics = {"arm_stiffness": (800.0, 1200.0), "arm_payload": 0.1}
    world = ah.make_world("juggle", 2, backend="robosuite", physics=physics)
    first = check_twins(world, steps, tmp_path)
    if steps == LAST:
        check_another_process(first, tmp_path)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("game", ["duel", "move_block"])
def test_copies_in_contact_go_on_to_the_same_bit(game, tmp_path):
    world = ah.make_world(game, 2)
    world.reset(3)
    state, memory = world.get_state()
    table = world.scene.table
    state.velocity[:] = 0.0
    state.paddle[:, 0] = (-0.4, 0.0)
    # The puck moves into the paddle, which pushes it.
    gap = table.paddle_radius + table.puck_radius - 1e-4
    state.puck[:, 0], state.puck_velocity[:, 0] = (-0.4 + gap, 0.0), (-0.5, 0.1)
    world.set_state(state, memory)
    assert world.state.touching.any()
    push = np.zeros((3, 2, len(world.open), 2))
    push[..., 0, 0] = 1.0
    play(world, push)
    given = actions(world, 30, 2)
    twins = [copy.deepcopy(world), pickle.loads(pickle.dumps(world))]
    first = play(world, given)
    for twin in twins:
        np.testing.assert_equal(play(twin, given), first)


def test_a_copy_before_the_first_reset_is_a_twin_too():
    world = ah.make_world("duel", 2)
    twin = pickle.loads(pickle.dumps(world))
    np.testing.assert_equal(twin.reset(1), world.reset(1))


@pytest.mark.parametrize("kind", ["parallel", "aec", "gymnasium", "single", "sb3"])
@pytest.mark.parametrize("how", ["deepcopy", "pickle"])
def test_environments_are_copied_in_mid_episode(kind, how):
    env, step = ENVIRONMENTS[kind]()
    for k in range(60):
        step(env, k)
    twin = copy.deepcopy(env) if how == "deepcopy" else pickle.loads(pickle.dumps(env))
    for k in range(60, 80):
        np.testing.assert_equal(step(twin, k), step(env, k))


def step_parallel(env, k):
    found = env.step({a: np.full(2, np.sin(k), np.float32) for a in env.agents})
    return [*found[0].values(), *found[1].values()]


def step_aec(env, k):
    env.step(np.full(2, np.sin(k), np.float32))
    seen, reward, *_ = env.last()
    return [seen, reward]


def step_vector(env, k):
    seen, reward, *_ = env.step(np.full((3, 2), np.sin(k), np.float32))
    return [seen, reward]


def step_single(env, k):
    seen, reward, ended, *_ = env.step(np.full(2, np.sin(k), np.float32))
    if ended:
        seen, _ = env.reset()
    return [seen, reward]


def started(env, **keywords):
    env.reset(**keywords)
    return env


def single():
    from marl_airhockey.envs.gymnasium_env import make_single

    return make_single("juggle", max_cycles=500)


ENVIRONMENTS = {
    "parallel": lambda: (started(ah.parallel_env("duel"), seed=1), step_parallel),
    "aec": lambda: (started(ah.env("duel"), seed=1), step_aec),
    "gymnasium": lambda: (started(ah.make_vec("juggle", 3), seed=1), step_vector),
    "single": lambda: (started(single(), seed=1), step_single),
    "sb3": lambda: (started(ah.make_sb3_vec("juggle", 3)), step_vector),
}


def test_a_copy_leaves_an_open_window_behind():
    pytest.importorskip("pygame")
    env = ah.parallel_env("duel", render_mode="human")
    env.reset(seed=0)
    twin = copy.deepcopy(env)
    assert env._renderer._window is not None
    assert twin._renderer._window is None
    env.close()
    twin.close()


def test_supersuit_trains_on_the_game_that_it_was_given():
    supersuit = pytest.importorskip("supersuit")

    def batch(steps):
        env = ah.parallel_env("duel", max_cycles=10_000)
        env.reset(seed=0)
        for k in range(steps):
            step_parallel(env, k)
        vec = supersuit.pettingzoo_env_to_vec_env_v1(env)
        return supersuit.concat_vec_envs_v1(vec, 2, base_class="gymnasium")

    used, fresh = batch(100), batch(0)
    np.testing.assert_equal(used.reset(seed=5), fresh.reset(seed=5))
    for k in range(120):
        actions = np.full((4, 2), np.sin(k), np.float32)
        for one, two in zip(
            used.step(actions)[:4], fresh.step(actions)[:4], strict=True
        ):
            np.testing.assert_equal(one, two)
