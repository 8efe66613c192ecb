"""Goal scenarios: reward, success and compute_reward agree, relabelled or not."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import marl_airhockey as ah
from marl_airhockey.discovery import gymnasium_id
from marl_airhockey.registry import make_scenario

PROFILES = ("ideal", "ur5e", "gantry")
GOAL_NAMES = ("achieved_goal", "desired_goal")


def test_every_goal_scenario_is_known_to_this_test(goal_scenario):
    assert make_scenario(goal_scenario, goals="dict").goals == "dict"


def test_only_goal_scenarios_have_dicts(scenario):
    from names import GOALS

    if scenario in GOALS:
        return
    with pytest.raises(ValueError, match="goal"):
        ah.parallel_env(scenario, goals="dict")


def test_it_passes_the_checks_of_goal_environments(goal_scenario):
    env = gymnasium.make(gymnasium_id(goal_scenario), goals="dict")
    check_env(env.unwrapped, skip_render_check=True)
    check_env_sb3(env.unwrapped)


@pytest.mark.parametrize("profile", PROFILES)
def test_reward_success_and_compute_reward_agree(goal_scenario, profile):
    """Reward and end follow what is shown, success the truth."""
    worlds = 400
    # A striker is too fast for the shots of hit_goal_velocity.
    scripts = {"hit_goal": "striker", "hit_goal_velocity": "sticky"}
    driver = scripts.get(goal_scenario, "reacher")
    world = ah.make_world(
        goal_scenario,
        worlds,
        goals="dict",
        drivers={"paddle_0": driver},
        profile=profile,
        observe="velocity",
    )
    world.autoreset = False
    world.reset(0)
    game = world.scenario
    achieved, rewards = [], []
    goal_met = np.zeros(worlds, bool)
    for _ in range(world.max_cycles):
        step = world.step(np.zeros((worlds, 0, 2)))
        wanted = game.desired(world.memory).astype(np.float32)
        shown = game.achieved(world.sensed, world.known.memory).astype(np.float32)
        achieved.append(shown)
        rewards.append(game.shown_reward(shown, wanted))
        true = game.achieved(world.state, world.memory).astype(np.float32)
        goal_met |= game.shown_reward(true, wanted) > 0
        np.testing.assert_array_equal(world.episode.success[:, 0], goal_met)
        # Only a met goal ends it: a dropped puck does not.
        np.testing.assert_array_equal(step.terminated, rewards[-1] > 0)
    np.testing.assert_allclose(world.episode.returns[:, 0], np.sum(rewards, axis=0))
    assert goal_met.any() or profile != "ideal"
    # Relabelled: what was achieved at any moment is a goal that it met there.
    late = np.array(achieved)
    counts = np.ones(late.shape[:2], bool)
    if goal_scenario.startswith("hit"):
        counts = late[..., -1] > 0.5
    np.testing.assert_array_equal(game.shown_reward(late, late) > 0, counts)


@pytest.mark.parametrize(
    ("profile", "observe"),
    [*((profile, "velocity") for profile in PROFILES), ("ur5e", "estimate")],
)
def test_rewards_are_those_of_the_observations(goal_scenario, profile, observe):
    """Of 10^4 steps of an environment, with paddles that go for goal or puck."""
    form = {"goals": "dict", "profile": profile, "observe": observe}
    if goal_scenario == "hit_goal":
        form["options"] = {"radius": 0.2, "shots": 50}  # Chance meets these.
    env = ah.make_sb3_vec(goal_scenario, 50, **form)
    env.seed(1)
    shown, rng, met = env.reset(), np.random.default_rng(0), 0
    target = "desired_goal" if goal_scenario.startswith("reach") else "achieved_goal"
    for k in range(200):
        way = 8 * (shown[target][:, :2] - shown["observation"][:, :2])
        luck = rng.uniform(-1, 1, (50, 2))
        actions = np.clip(way if k % 3 else luck, -1, 1).astype(np.float32)
        shown, rewards, done, infos = env.step(actions)
        last = [
            info["terminal_observation"] if d else {k: v[i] for k, v in shown.items()}
            for i, (info, d) in enumerate(zip(infos, done, strict=True))
        ]
        goals = (np.array([o[n] for o in last]) for n in GOAL_NAMES)
        np.testing.assert_array_equal(env.compute_reward(*goals, {}), rewards)
        met += int(rewards.sum())
    assert met > 0


def test_compute_reward_is_vectorised(goal_scenario):
    env = gymnasium.make(gymnasium_id(goal_scenario), goals="dict").unwrapped
    env.reset(seed=0)
    size = env.observation_space["desired_goal"].shape[0]
    goals = np.random.default_rng(0).uniform(-0.3, 0.3, (7, 5, size))
    goals[..., -1] = 1.0
    assert env.compute_reward(goals, goals, {}).shape == (7, 5)
    assert env.compute_reward(goals[0, 0], goals[0, 0], {}).shape == ()


def test_sac_with_her_trains_on_a_vector_environment():
    venv = ah.make_sb3_vec("reach", 4, goals="dict")
    model = SAC(
        "MultiInputPolicy",
        venv,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "copy_info_dict": False},
        learning_starts=300,
        batch_size=64,
        policy_kwargs={"net_arch": [16]},
        seed=0,
    )
    model.learn(400)
    assert model.num_timesteps >= 400
    assert model.replay_buffer.sample(32).rewards.mean() > 0
