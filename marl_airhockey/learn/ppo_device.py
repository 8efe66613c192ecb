"""Engine "device": PPO whose worlds are computed where the networks are.

Rollouts stay on the device. Only their means are copied to the CPU, once per rollout. A
GPU repeats the kernels of a rollout as one CUDA graph.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.cuda_graph import Recorded
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
        # A resumed run must not repeat the episodes of its beginning.
        self._worlds.reset(config.seed * 10_000 + run.progress.steps % 9973)
        self._observation = self._slots()
        # With an even number of steps, each rollout begins in the same moment's arrays.
        graph = config.cuda_graph and config.n_steps % 2 == 0
        self._recorded = Recorded(self._play, graph and self._device.type == "cuda")
        end_setup(run)

    def _slots(self) -> Tensor:
        """Return the observation of all slots (B S, D), world by world."""
        return self._worlds.observation().flatten(0, 1)

    def _collect(self) -> Rollout:
        rollout, finished, successful = self._recorded()
        self._worlds.check()
        self._observation = self._slots()
        self._log.record("rollout/episodes", float(finished) / self._worlds.seats)
        if finished:
            self._log.record("rollout/success", float(successful / finished))
        return rollout

    def _play(self) -> tuple[Rollout, Tensor, Tensor]:
        """Play ``n_steps`` steps of all slots, without waiting for the device.

        Returns:
            Steps, number of slots whose episode ended, and number of those that ended
            with success.
        """
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
                observation = model.scaled(self._slots())
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
        return rollout, finished, successful


def train_on_device(run: TrainingRun[PPOConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return DeviceTrainer(run).train()
