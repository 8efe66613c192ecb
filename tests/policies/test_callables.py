"""Players of one's own: functions, models, modules and classes as drivers."""

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

import marl_airhockey as ah
from marl_airhockey.toolkit import Driver


class Still(Driver):
    def act(self, view, memory):
        return np.zeros((len(view.observation), 2)), memory


class Plain:
    """Model whose `predict` knows nothing of `deterministic`."""

    def predict(self, observation):
        return np.tile([0.3, -0.2], (len(observation), 1))


def commands(player, steps=3, **keywords):
    """Return what a player asks for in three duels, and what built its seat."""
    world = ah.make_world("duel", 3, drivers={"paddle_1": player}, **keywords)
    world.reset(0)
    for _ in range(steps):
        world.step(np.zeros((3, 1, 2)))
    return world.action[:, 1]


def test_a_function_of_a_batch_or_of_one_observation_drives():
    many = commands(lambda seen: seen[:, :2])
    one = commands(lambda seen: seen[:2])
    np.testing.assert_array_equal(many, one)
    assert np.abs(many).max() > 0
    assert np.allclose(commands(lambda seen: (0.5, -0.5)), [0.5, -0.5])


def test_modules_models_and_classes_drive():
    size = ah.parallel_env("duel").observation_space("paddle_0").shape[0]
    net = torch.nn.Sequential(torch.nn.Linear(size, 2), torch.nn.Tanh())
    assert np.abs(commands(net)).max() > 0
    assert np.allclose(commands(Plain()), [0.3, -0.2])
    model = PPO("MlpPolicy", ah.make_sb3_vec("duel", 2), n_steps=8, batch_size=8)
    assert np.abs(commands(model)).max() > 0
    assert np.abs(commands(Still)).max() == np.abs(commands(Still())).max() == 0.0


def test_a_function_of_goals_and_one_of_pixels_drive():
    for observe, shape in (("velocity", None), ("pixels", (84, 84, 3))):
        seen = []
        keywords = {"observe": observe} if shape else {"goals": "dict"}

        def act(observation, seen=seen):
            seen.append(observation)
            return np.zeros(2)

        world = ah.make_world("reach", drivers={"paddle_0": act}, **keywords)
        world.reset(seed=0)
        world.step(np.zeros((1, 0, 2)))
        shown = seen[-1]
        if shape:
            assert shown.shape == shape
        else:
            assert set(shown) == {"observation", "achieved_goal", "desired_goal"}


@pytest.mark.parametrize(
    ("player", "message"),
    [
        (
            lambda seen: 1.0,
            r"shape \(\).*expected finite actions of shape \(3, 2\) or \(2,\)",
        ),
        (lambda seen: seen["puck"], "IndexError"),
        (torch.nn.Linear(5, 2), "cannot be multiplied"),
        (7, "int 7 is not a driver"),
        (Plain, "the class is not a Driver"),
        (None, "None is not a driver"),
    ],
)
def test_a_player_that_does_not_fit_is_refused_when_built(player, message):
    with pytest.raises(ValueError, match=message):
        ah.make_world("duel", 2, drivers={"paddle_1": player})


def test_a_model_for_another_task_is_refused_when_built():
    model = PPO("MlpPolicy", ah.make_sb3_vec("reach", 2), n_steps=8, batch_size=8)
    with pytest.raises(ValueError, match="Unexpected observation shape"):
        ah.make_world("duel", 2, drivers={"paddle_1": model})
    with pytest.raises(ValueError, match="expects observations of shape"):
        ah.make_world("duel", 2, drivers={"paddle_1": "zoo/reach"})


def test_what_a_player_raises_in_play_is_raised():
    asked = []

    def tires(seen):
        asked.append(seen)
        if len(asked) > 3:
            raise KeyError("tired")
        return np.zeros((len(seen), 2))

    with pytest.raises(KeyError, match="tired"):
        commands(tires, steps=10)
