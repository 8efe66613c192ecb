"""What every scenario owes, on every backend; found by folder, listed nowhere."""

import subprocess
import sys
import types

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers import seeded
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
    seed_test,
    state_test,
)
from pettingzoo.utils.conversions import parallel_to_aec
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import marl_airhockey as ah
from marl_airhockey.discovery import gymnasium_id
from marl_airhockey.envs.meanings import term_meanings
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.scenario import Scenario, Transition
from marl_airhockey.sim.core.state import ARRAYS

CHANCE = {"still": 0.02, "random": 0.10, "sticky": 0.10}


def alone(scenario):
    """Keywords that leave one seat open."""
    others = range(1, len(ah.make_scenario(scenario).scene.seats))
    return {"drivers": {f"paddle_{i}": "sticky" for i in others}}


def test_pettingzoo_parallel_api(scenario, backend):
    parallel_api_test(ah.parallel_env(scenario, backend=backend), num_cycles=400)


def test_pettingzoo_aec_api(scenario, backend):
    env = parallel_to_aec(ah.parallel_env(scenario, backend=backend))
    api_test(env, num_cycles=200, verbose_progress=False)


def test_pettingzoo_seeds(scenario, backend):
    parallel_seed_test(lambda: ah.parallel_env(scenario, backend=backend), 60)
    seed_test(lambda: ah.env(scenario, backend=backend), num_cycles=30)


def test_pettingzoo_max_cycles(scenario, backend):
    def seeded(max_cycles):
        # The test resets without a seed, and luck can end an episode at its first step.
        env = ah.parallel_env(scenario, backend=backend, max_cycles=max_cycles)
        env.world.seed(0)
        for agent in env.possible_agents:
            env.action_space(agent).seed(0)
        return env

    module = types.SimpleNamespace(
        env=lambda max_cycles: parallel_to_aec(seeded(max_cycles)), parallel_env=seeded
    )
    max_cycles_test(module)


def test_pettingzoo_render_and_state(scenario, backend):
    render_test(
        lambda render_mode=None: parallel_to_aec(
            ah.parallel_env(scenario, render_mode, backend=backend)
        )
    )
    parallel = ah.parallel_env(scenario, backend=backend)
    state_test(parallel_to_aec(parallel), parallel)


def test_gymnasium_and_sb3_checks(scenario, backend):
    env = gymnasium.make(
        f"marl_airhockey:{gymnasium_id(scenario)}",
        backend=backend,
        render_mode="rgb_array",
        **alone(scenario),
    )
    check_env(env.unwrapped)
    check_env_sb3(env.unwrapped)
    env.close()


def test_the_same_seed_gives_the_same_episodes_in_another_process():
    command = [sys.executable, seeded.__file__]
    other = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert other.split("\n")[:-1] == seeded.hashes()
    assert len(set(other.split("\n"))) == 2 * len(ah.scenario_names()) + 1


def test_a_reset_with_the_same_seed_forgets_what_was_played(scenario, backend):
    seats = range(len(ah.make_scenario(scenario).scene.seats))
    drivers = {f"paddle_{k}": "random" for k in seats}
    world = ah.make_world(scenario, 2, backend=backend, drivers=drivers, max_cycles=120)
    world.autoreset = False
    first, _, again = (list(play_episodes(world, 2, seed)) for seed in (3, 9, 3))
    for one, other in zip(first, again, strict=True):
        for name, value in one.columns.items():
            np.testing.assert_array_equal(value, other.columns[name], name)


def test_a_row_of_many_worlds_equals_a_single_world(scenario, backend):
    many = ah.make_world(scenario, 8, backend=backend)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (130, 8, len(many.open), 2))
    seen = [many.reset(20)] + [many.step(a).observation for a in actions]
    for row in (0, 5):
        one = ah.make_world(scenario, 1, backend=backend)
        single = [one.reset(20 + row)]
        single += [one.step(a[row : row + 1]).observation for a in actions]
        for a, b in zip(seen, single, strict=True):
            np.testing.assert_array_equal(a[row], b[0])


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("profile", ["ideal", "ur5e"])
def test_observations_lie_in_their_space_and_none_is_constant(
    scenario, backend, profile
):
    keywords = {"backend": backend, "profile": profile, **alone(scenario)}
    env = ah.make_vec(scenario, 32, **keywords)
    seen, _ = env.reset(seed=0)
    rows = [seen]
    for _ in range(160):
        # Chasing the puck, where there is one, shows what only contacts change.
        action = env.action_space.sample()
        labels = env.world.observer.layout.labels
        if "own_to_puck_0.dx" in labels:
            chase = 8 * rows[-1][:, labels.index("own_to_puck_0.dx") :][:, :2]
            action[::2] = np.clip(chase[::2], -1, 1)
        rows.append(env.step(action)[0])
        assert env.observation_space.contains(rows[-1])
    spread = np.ptp(np.concatenate(rows), axis=0)
    labels = env.world.observer.layout.labels
    dull = [label for label, s in zip(labels, spread, strict=True) if s == 0]
    assert not dull


def test_every_documented_reward_term_is_paid(scenario):
    game = ah.make_scenario(scenario)
    documented = term_meanings(type(game)).keys() - term_meanings(Scenario).keys()
    off = {name for name in documented if getattr(game, f"{name}_weight", 1.0) == 0.0}
    world = ah.make_world(scenario, 1)
    world.reset(0)
    step = world.step(np.zeros((1, len(world.open), 2)))
    assert documented - off <= step.terms.keys()


def test_a_time_limit_truncates_and_does_not_terminate(scenario):
    world = ah.make_world(scenario, 4, max_cycles=3)
    world.reset(0)
    still = np.zeros((4, len(world.open), 2))
    for ended in (False, False, True):
        step = world.step(still)
        assert not step.terminated.any()
        assert (step.truncated == ended).all()


def test_observations_share_no_memory_and_starts_vary(scenario, backend):
    world = ah.make_world(scenario, 4, backend=backend)
    first = world.reset(0)
    kept = first.copy()
    assert len(np.unique(first.reshape(4, -1), axis=0)) == 4
    second = world.step(np.ones((4, len(world.open), 2))).observation
    np.testing.assert_array_equal(first, kept)
    assert not np.shares_memory(first, second)


def test_judging_a_recording_equals_judging_step_by_step(scenario, backend):
    worlds, steps = 6, 60
    world = ah.make_world(scenario, worlds, backend=backend, max_cycles=10_000)
    world.autoreset = False
    world.reset(4)
    game, start = world.scenario, world.memory
    states, command, rewards = [world.state], [], []
    rng = np.random.default_rng(1)
    for _ in range(steps):
        step = world.step(rng.uniform(-1, 1, (worlds, len(world.open), 2)))
        states.append(world.state)
        command.append(world.command)
        rewards.append(step.reward)

    def stack(name):
        return np.stack([getattr(s, name) for s in states])

    path = None if states[0].path is None else stack("path")
    recording = type(states[1])(
        game.scene.bodies, **{name: stack(name) for name in ARRAYS}, path=path
    )
    command = np.stack(command)
    memory = game.replay_memory(start, recording, command)
    before, after = (
        recording.map(lambda x, s=s: x[s]) for s in (slice(None, -1), slice(1, None))
    )
    old = {k: v[:-1] for k, v in memory.items()}
    new = {k: v[1:] for k, v in memory.items()}
    never = np.zeros(after.time.shape, bool)
    terms = game.all_reward_terms(Transition(before, command, after, old, new, never))
    np.testing.assert_allclose(sum(terms.values()), rewards, atol=1e-12)
    for name, value in world.memory.items():
        # The loop's exp and numpy's differ in the last digit.
        np.testing.assert_allclose(memory[name][-1], value, rtol=1e-12)


def test_rewards_are_the_sum_of_their_terms(scenario, backend):
    env = ah.parallel_env(scenario, backend=backend)
    env.reset(seed=2)
    for _ in range(20):
        _, reward, _, _, info = env.step(
            {a: np.ones(2, np.float32) for a in env.agents}
        )
        for agent, value in reward.items():
            assert value == pytest.approx(
                sum(v for k, v in info[agent].items() if k.startswith("reward/"))
            )
        if not env.agents:
            break


@pytest.mark.parametrize("driver", list(CHANCE))
def test_chance_level_is_low(single, driver):
    # A matter of the rules, not of the backend: backends agree, as other tests show.
    result = evaluate(driver, single, episodes=400, seed=0)
    if single == "touch":
        # A falling puck meets a still paddle one time in four.
        assert 0.15 < result.success < 0.40
    else:
        assert result.success <= CHANCE[driver]


@pytest.mark.usefixtures("uncompiled")
def test_options_reach_the_scenario(scenario, backend):
    for seats in ("robot", "arcade"):
        env = ah.parallel_env(scenario, backend=backend, seats=seats)
        env.reset(seed=0)
        assert env.world.scene.seats[0].speed == {"robot": 0.7, "arcade": 5.0}[seats]
    short = ah.parallel_env(scenario, backend=backend, options={"seconds": 0.5})
    assert short.max_cycles == 10
