"""Network and env runner of the engine "rllib"."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from ray.rllib.core import DEFAULT_MODULE_ID
from ray.rllib.core.columns import Columns
from ray.rllib.core.distribution.torch.torch_distribution import TorchDiagGaussian
from ray.rllib.core.rl_module.apis import ValueFunctionAPI
from ray.rllib.core.rl_module.torch import TorchRLModule
from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner
from ray.rllib.env.single_agent_episode import SingleAgentEpisode
from ray.rllib.env.utils.infinite_lookback_buffer import InfiniteLookbackBuffer

from marl_airhockey.learn.networks import ActorCritic
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.self_play import SelfPlayEnv, make_training_env
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.types import Array

RUNNER_CPU = "runner_cpu_seconds"
"""Name of the metric with the CPU time of the env runners, s."""


class PolicyModule(TorchRLModule, ValueFunctionAPI):
    """`ActorCritic` as a module of RLlib."""

    def setup(self) -> None:
        names = "hidden", "log_std_init", "centre", "unit"
        self.net = ActorCritic(*(self.model_config[name] for name in names))

    def _forward(self, batch: dict[str, Any], **_: Any) -> dict[str, Any]:
        mean = self.net.actor(self.net.scaled(batch[Columns.OBS]))
        spread = self.net.log_std.expand_as(mean)
        return {Columns.ACTION_DIST_INPUTS: torch.cat([mean, spread], dim=-1)}

    def compute_values(self, batch: dict[str, Any], embeddings: Any = None) -> Any:
        return self.net.critic(self.net.scaled(batch[Columns.OBS])).squeeze(-1)

    def get_train_action_dist_cls(self) -> type[TorchDiagGaussian]:
        return TorchDiagGaussian

    get_exploration_action_dist_cls = get_train_action_dist_cls
    get_inference_action_dist_cls = get_train_action_dist_cls

    def to_numpy(self) -> NumpyPolicy:
        """Return the actor as a NumPy policy."""
        return self.net.to_numpy(self.model_config["card"])


class BatchRunner(SingleAgentEnvRunner):
    """Env runner that steps a batch of worlds; each slot returns chunks of episodes."""

    def make_env(self) -> None:
        settings = self.config.env_config
        self._train: PPOConfig = settings["train"]
        shares = max(self.num_workers or 0, 1)
        pool = Path(settings["folder"]) / f"pool-{self.worker_index or 0}"
        self.env = make_training_env(
            self._train, self._train.num_worlds // shares, pool
        )
        self.num_envs = self.env.num_envs
        # A runner that replaces a failed one must not repeat its episodes.
        self.env.seed(time.time_ns() % 2**31 if settings["begun"] else self._seed)
        self._seen: Array = self.env.reset()
        self._shares, self._own_steps, self._due = shares, 0, 0

    def get_spaces(self) -> dict[str, tuple[Any, Any]]:
        if self.env is None:
            return dict(self.spaces)
        return {DEFAULT_MODULE_ID: (self.env.observation_space, self.env.action_space)}

    def sample(self, **_: Any) -> list[SingleAgentEpisode]:
        """Step all worlds ``n_steps`` times and return the chunks of episodes."""
        cpu = time.process_time()
        self._take_snapshot()
        steps, slots = self._train.n_steps, self.num_envs
        seen = np.empty((steps + 1, *self._seen.shape), np.float32)
        chosen = np.empty((steps, slots, 2), np.float32)
        parameters = np.empty((steps, slots, 4), np.float32)
        logp, reward = np.empty((2, steps, slots), np.float32)
        done = np.zeros((steps, slots), np.bool_)
        finals: dict[tuple[int, int], dict[str, Any]] = {}
        for t in range(steps):
            seen[t] = self._seen
            with torch.no_grad():
                batch = {Columns.OBS: torch.from_numpy(seen[t])}
                out = self.module.forward_exploration(batch)
                inputs = out[Columns.ACTION_DIST_INPUTS]
                distribution = TorchDiagGaussian.from_logits(inputs)
                action = distribution.sample()
                logp[t] = distribution.logp(action).numpy()
                parameters[t] = inputs.numpy()
            chosen[t] = action.numpy()
            given = np.clip(chosen[t], -1.0, 1.0)
            self._seen, reward[t], done[t], infos = self.env.step(given)
            for slot in np.flatnonzero(done[t]).tolist():
                finals[t, slot] = infos[slot]
        seen[steps] = self._seen
        columns = {Columns.ACTION_DIST_INPUTS: parameters, Columns.ACTION_LOGP: logp}
        episodes: list[SingleAgentEpisode] = []
        for slot in range(slots):
            cuts = (np.flatnonzero(done[:, slot]) + 1).tolist()
            for a, b in zip([0, *cuts], [*cuts, steps], strict=True):
                if a == b:
                    continue
                final = finals.get((b - 1, slot))
                rows = seen[a : b + 1, slot]
                if final is not None:
                    rows = rows.copy()
                    rows[-1] = final["terminal_observation"]
                episodes.append(
                    _chunk(
                        rows,
                        chosen[a:b, slot],
                        reward[a:b, slot],
                        {name: column[a:b, slot] for name, column in columns.items()},
                        final,
                    )
                )
        self._log(finals, time.process_time() - cpu)
        return episodes

    def _take_snapshot(self) -> None:
        """Add the current policy to this runner's pool of opponents if it is due."""
        steps = max(self._own_steps * self._shares, self.num_env_steps_sampled_lifetime)
        if isinstance(self.env, SelfPlayEnv) and steps >= self._due:
            self.env.snapshot(self.module.to_numpy(), steps)
            every = self._train.total_steps // self._train.snapshots
            self._due = (steps // every + 1) * every

    def _log(self, finals: dict[Any, dict[str, Any]], cpu: float) -> None:
        steps = self._train.n_steps * self.num_envs
        self._own_steps += steps
        self.num_env_steps_sampled_lifetime += steps
        self._increase_sampled_metrics(steps, len(finals))
        self.metrics.log_value(RUNNER_CPU, cpu, reduce="sum")
        for final in finals.values():
            self._log_episode_metrics(final["episode"]["l"], final["episode"]["r"], 0.0)


def _chunk(
    seen: Array,
    chosen: Array,
    reward: Array,
    columns: dict[str, Array],
    final: dict[str, Any] | None,
) -> SingleAgentEpisode:
    """Return a chunk of an episode, which has ended if an info ``final`` is given."""
    truncated = final is not None and final["TimeLimit.truncated"]
    return SingleAgentEpisode(
        observations=InfiniteLookbackBuffer(seen),
        infos=InfiniteLookbackBuffer([{}] * len(seen)),
        actions=InfiniteLookbackBuffer(chosen),
        rewards=InfiniteLookbackBuffer(reward),
        extra_model_outputs={k: InfiniteLookbackBuffer(v) for k, v in columns.items()},
        terminated=final is not None and not truncated,
        truncated=truncated,
        len_lookback_buffer=0,
    )
