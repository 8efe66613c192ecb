"""Engine "device": PPO whose worlds are computed where the networks are.

Rollouts stay on the device. Only their means are copied to the CPU, once per rollout.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.engine import end_setup, training_threads
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.ppo import Rollout, Trainer
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import TrainingRun


class DeviceTrainer(Trainer):
    """PPO trainer of a run with worlds on its device.

    The learner plays all seats. Episodes begin with the starts of `DeviceWorld`.

    Args:
        run: Run whose folder is updated.
    """

    def __init__(self, run: TrainingRun[PPOConfig]) -> None:
        config = run.config
        # A single world of the CPU describes the observations.
        super().__init__(run, SlotEnv(config.scenario, 1, **config.training_keywords))
        self._worlds = DeviceWorld(
            config.scenario,
            config.num_worlds,
            str(self._device),
            keywords=config.training_keywords,
        )
        self._observation = self._slots(self._worlds.reset())
        end_setup(run)

    def _slots(self, rows: Tensor) -> Tensor:
        """Return rows of worlds and seats (B, S, ...) as a new array of slots."""
        return rows.flatten(0, 1).clone()

    def _collect(self) -> Rollout:
        config, model, worlds = self._config, self.model, self._worlds
        seats = worlds.seats
        made: dict[str, Any] = {"device": self._device}
        shape = config.n_steps, worlds.num_worlds * seats
        rollout = Rollout(
            torch.empty(*shape, len(model.centre), **made),
            torch.empty(*shape, 2, **made),
            torch.empty(shape, **made),
            torch.empty(shape, **made),
            torch.empty(shape, **made),
            truncated=[],
            success=[],
        )
        finished, successful = torch.zeros((), **made), torch.zeros((), **made)
        with torch.inference_mode():
            spread = model.log_std.exp()
            for t in range(config.n_steps):
                observation = model.scaled(self._observation)
                mean = model.actor(observation)
                action = mean + spread * torch.randn_like(mean)
                rollout.observation[t], rollout.action[t] = observation, action
                rollout.density[t] = model.log_density(mean, action)
                moved = action.clamp(-1.0, 1.0).unflatten(0, (-1, seats))
                step = worlds.step(moved)
                ended = (step.terminated | step.truncated).repeat_interleave(seats)
                out_of_time = ended & ~step.terminated.repeat_interleave(seats)
                final = model.scaled(step.final_observation.flatten(0, 1))
                beyond = config.gamma * model.critic(final)[:, 0]
                reward = step.reward.flatten() + beyond.where(out_of_time, 0.0)
                rollout.reward[t], rollout.not_done[t] = reward, (~ended).float()
                finished += ended.sum()
                successful += (step.success.flatten() & ended).sum()
                self._observation = self._slots(step.observation)
        worlds.check()
        self._log.record("rollout/episodes", float(finished) / seats)
        if finished:
            self._log.record("rollout/success", float(successful / finished))
        return rollout


def train_on_device(run: TrainingRun[PPOConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return DeviceTrainer(run).train()
