"""Engine "torch": PPO in plain torch over B worlds in one process.

The algorithm is that of Schulman et al. (2017) as in stable-baselines3, so presets are
valid for both engines. This file omits the parts of that library that are not needed,
which take a third of the CPU time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.advantages import generalized_advantage
from marl_airhockey.learn.device import moved, torch_device
from marl_airhockey.learn.engine import (
    AdaptiveRate,
    end_setup,
    evaluate_and_record,
    initial_weights,
    load_state,
    note_step,
    other_size,
    save_weights,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.exploiters import Exploiters
from marl_airhockey.learn.logs import RunLog
from marl_airhockey.learn.networks import ActorCritic
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.self_play import SelfPlayEnv, make_training_env
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import policy_driver

VALUE_WEIGHT = 0.5
"""Weight of the critic's squared error in the loss."""
MASTERED, FEWEST_EPISODES, WIDER = 0.8, 20, 0.05
"""Conditions and step of a curriculum: ranges of starts widen by `WIDER` if at least
`FEWEST_EPISODES` episodes of a rollout end with a success of at least `MASTERED`."""


@dataclass
class Rollout:
    """Steps of all slots between two updates; tensors are (T, n, ...)."""

    observation: Tensor
    """Scaled observations."""
    action: Tensor
    density: Tensor
    """Log density of the actions."""
    reward: Tensor
    not_done: Tensor
    """0 where an episode ended with the step, else 1."""
    truncated: list[tuple[int, int, Any]]
    """Step, slot and last observation of truncated episodes."""
    success: list[bool]
    """Success of the episodes that ended."""


class Trainer:
    """PPO trainer of a run.

    Args:
        run: Run whose folder is updated.
        env: Worlds of the training; None for those of the configuration.
    """

    def __init__(self, run: TrainingRun[PPOConfig], env: SlotEnv | None = None) -> None:
        config = self._config = run.config
        self._run = run
        self._device = torch_device(config.device)
        torch.manual_seed(config.seed)
        pool = run.folder / "pool"
        self._env = env or make_training_env(config, config.num_worlds, pool)
        layout = self._env.world.observer.layout
        self.model = ActorCritic(
            config.hidden, config.log_std_init, layout.centre, layout.unit
        ).to(self._device)
        self._rate = AdaptiveRate(config, run.progress.rate or config.learning_rate)
        self._optimizer = torch.optim.Adam(
            self.model.parameters(), eps=1e-5, fused=True
        )
        self._snapshot_due = run.progress.steps
        self._exploiters = Exploiters(run)
        if run.progress.steps:
            self._load(run.folder / "last.pt", whole=True)
        elif config.init:
            self._load(initial_weights(config), whole=False)
        self._widen([])
        # A resumed run must not repeat the episodes of its beginning.
        self._env.seed(config.seed * 10_000 + run.progress.steps % 9973)
        self._log = RunLog(run.folder, run.progress.steps)
        self._observation = moved(self._env.reset(), self._device)
        end_setup(run)

    def train(self) -> Metrics:
        """Train to the end of the run; return the last evaluation."""
        row = self._run.train(self._advance, self._evaluate, self._log)
        self._env.close()
        return row

    def _advance(self) -> tuple[int, float]:
        """Play a rollout and learn from it; return the steps so far and the rate."""
        self._grow_pool()
        rollout = self._collect()
        steps = self._run.progress.steps + rollout.reward.numel()
        divergence = self._update(rollout, 1.0 - steps / self._config.total_steps)
        self._rate.adapt(divergence)
        self._widen(rollout.success)
        return steps, self._rate.rate

    def _widen(self, success: list[bool]) -> None:
        """Widen the ranges of starts of a curriculum after a successful rollout."""
        if not self._config.curriculum:
            return
        progress = self._run.progress
        spread = progress.start_spread or self._config.curriculum
        if len(success) >= FEWEST_EPISODES and np.mean(success) >= MASTERED:
            spread = min(spread + WIDER, 1.0)
        self._env.world.start_spread = progress.start_spread = spread

    def _collect(self) -> Rollout:
        """Play ``n_steps`` steps of all slots."""
        config, env, model, device = self._config, self._env, self.model, self._device
        shape = config.n_steps, env.num_envs
        reward, not_done = torch.empty(shape), torch.ones(shape)
        rollout = Rollout(
            torch.empty(*shape, len(model.centre), device=device),
            torch.empty(*shape, 2, device=device),
            torch.empty(shape, device=device),
            *(reward, not_done),
            truncated=[],
            success=[],
        )
        with torch.inference_mode():
            spread = model.log_std.exp()
            for t in range(config.n_steps):
                observation = model.scaled(self._observation)
                rollout.observation[t] = observation
                mean = model.actor(observation)
                action = mean + spread * torch.randn_like(mean)
                rollout.action[t] = action
                rollout.density[t] = model.log_density(mean, action)
                moves = action.clamp(-1.0, 1.0).cpu().numpy()
                seen, gained, done, infos = env.step(moves)
                self._observation = moved(seen, device)
                reward[t] = torch.from_numpy(gained)
                not_done[t] = torch.from_numpy(1.0 - done)
                ended = np.flatnonzero(done).tolist()
                rollout.success += [infos[i]["is_success"] for i in ended]
                rollout.truncated += [
                    (t, i, infos[i]["terminal_observation"])
                    for i in ended
                    if infos[i]["TimeLimit.truncated"]
                ]
                note_step(self._log, env)
        rollout.reward, rollout.not_done = reward.to(device), not_done.to(device)
        return rollout

    def _advantages(self, rollout: Rollout) -> tuple[Tensor, Tensor]:
        """Return advantages and returns (T, n) (Schulman et al., 2016)."""
        config, model = self._config, self.model
        with torch.inference_mode():
            value = model.critic(rollout.observation)[..., 0]
            last = model.critic(model.scaled(self._observation))[:, 0]
            reward = rollout.reward
            if rollout.truncated:
                steps, slots, seen = zip(*rollout.truncated, strict=True)
                ends = moved(np.stack(seen), self._device)
                beyond = model.critic(model.scaled(ends))
                reward[list(steps), list(slots)] += config.gamma * beyond[:, 0]
            advantage = generalized_advantage(
                reward, value, last, rollout.not_done, config.gamma, config.gae_lambda
            )
            return advantage, advantage + value

    def _update(self, rollout: Rollout, remaining: float) -> float:
        """Improve the policy; return the KL divergence in the last epoch."""
        config, rate = self._config, self._rate(max(remaining, 0.0))
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        advantage, returns = self._advantages(rollout)
        flat = [
            rollout.observation.flatten(0, 1),
            rollout.action.flatten(0, 1),
            *(x.flatten() for x in (rollout.density, advantage, returns)),
        ]
        size, divergences = len(flat[-1]), list[Tensor]()
        for _ in range(config.n_epochs):
            order, divergences = torch.randperm(size, device=self._device), []
            mixed = [x.index_select(0, order) for x in flat]
            for low in range(0, size, config.batch_size):
                part = [x[low : low + config.batch_size] for x in mixed]
                divergences.append(self._descend(*part))
        divergence = float(np.mean([float(each) for each in divergences]))
        self._log.record("train/approx_kl", divergence)
        self._log.record("train/learning_rate", rate)
        self._log.record("train/std", float(self.model.log_std.detach().exp().mean()))
        return divergence

    def _descend(
        self,
        observation: Tensor,
        action: Tensor,
        density: Tensor,
        advantage: Tensor,
        returns: Tensor,
    ) -> Tensor:
        """Make one gradient step on a minibatch; return its KL divergence."""
        model, clip = self.model, self._config.clip_range
        change = model.log_density(model.actor(observation), action) - density
        ratio = change.exp()
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        clipped = ratio.clamp(1.0 - clip, 1.0 + clip)
        loss = -torch.min(ratio * advantage, clipped * advantage).mean()
        error = nn.functional.mse_loss(model.critic(observation)[:, 0], returns)
        # The entropy of a normal distribution is its log deviation plus a constant.
        loss = loss + VALUE_WEIGHT * error - self._config.ent_coef * model.log_std.sum()
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(model.parameters(), self._config.max_grad_norm)
        self._optimizer.step()
        return (ratio.detach() - 1.0 - change.detach()).mean()

    def _policy(self) -> NumpyPolicy:
        card = self._config.card(self._env.world.observer.layout.labels)
        return self.model.to_numpy({**card, "steps": self._run.progress.steps})

    def _grow_pool(self) -> None:
        """Add a snapshot and an exploiter to the pool of opponents if they are due."""
        env, steps = self._env, self._run.progress.steps
        if not isinstance(env, SelfPlayEnv):
            return
        if steps >= self._snapshot_due:
            env.snapshot(self._policy(), steps)
            self._snapshot_due += self._config.total_steps // self._config.snapshots
        if (run := self._exploiters.due(self._save_in)) is not None:
            with torch.random.fork_rng():
                Trainer(run).train()
            env.add_opponent(self._exploiters.join(run))

    def _evaluate(self) -> Metrics:
        """Evaluate and save the policy; return the row of the evaluation."""
        run, policy = self._run, self._policy()
        make = partial(policy_driver, policy, "training")
        save = partial(self._save_in, run.folder)
        row = evaluate_and_record(run, make, self._log, save)
        if run.config.self_play:
            policy.save(run.checkpoint_path)
        return row

    def _save_in(self, folder: Path, name: str) -> None:
        """Save the policy and everything that a resumed run needs, under a name."""
        save_weights(folder, name, self.model, self._optimizer, self._policy())

    def _load(self, path: Path, whole: bool) -> None:
        """Read weights and, with ``whole``, the optimizer; run no code in the file."""
        state = load_state(path)
        try:
            self.model.load_state_dict(state["model"])
        except RuntimeError as error:
            raise other_size(path, error) from error
        if whole:
            self._optimizer.load_state_dict(state["optimizer"])


def train_with_torch(run: TrainingRun[PPOConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return Trainer(run).train()
