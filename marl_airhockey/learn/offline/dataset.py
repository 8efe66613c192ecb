"""Dataset: steps of one seat in recordings, as tensors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from marl_airhockey.data.reader import episodes_of
from marl_airhockey.learn.offline.choice import best_of
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.types import Array

GOALS = tuple(
    f"observation.{part}" for part in ("observation", "achieved_goal", "desired_goal")
)
"""Columns of observations with goals="dict", in the order in which they are joined."""
NEEDED = ("observation", *GOALS, "action", "reward", "terminated")
"""Columns that are read."""


class StepBatch(NamedTuple):
    """Batch of n steps of one seat."""

    observation: Tensor
    """Observations before the steps, (n, D)."""
    action: Tensor
    """Actions, -1 to 1, (n, 2)."""
    reward: Tensor
    """Rewards, divided by the `reward_scale` of the dataset, (n,)."""
    next_observation: Tensor
    """Observations after the steps, (n, D)."""
    next_action: Tensor
    """Actions of the next steps, (n, 2). The last step of an episode has its own
    action."""
    not_done: Tensor
    """0 where the episode was terminated by the step, else 1, (n,). It is 1 at a time
    limit."""


@dataclass(frozen=True)
class Dataset:
    """Dataset of N steps of one seat."""

    steps: StepBatch
    """All N steps."""
    reward_scale: float
    """Standard deviation of the discounted returns that follow the steps."""

    def __len__(self) -> int:
        return len(self.steps.action)

    def to(self, device: torch.device) -> Dataset:
        """Return the dataset on a device."""
        return replace(self, steps=StepBatch(*(x.to(device) for x in self.steps)))

    def sample(self, count: int) -> StepBatch:
        """Return ``count`` steps, sampled with replacement."""
        rows = torch.randint(len(self), (count,), device=self.steps.action.device)
        return StepBatch(*(x.index_select(0, rows) for x in self.steps))


def load_dataset(
    files: Sequence[Path], seat: int, share: float, gamma: float, size: int
) -> Dataset:
    """Read recordings.

    Args:
        files: Paths of the recordings.
        seat: Index of the seat whose steps are read.
        share: Share of the episodes that are read, those with the highest returns.
        gamma: Discount of the returns that define the scale of the rewards.
        size: Number of elements of the observations of the scenario, D.

    Raises:
        ValueError: A recording has no steps, no observations, or observations of
            another size. The message names it.
    """
    episodes = [
        _seat_of(path, episode, seat, size) for path, episode in _episodes(files)
    ]
    if not episodes:
        raise ValueError(f"{files[0]}: the recording has no steps")
    returns = [float(parts["reward"].sum()) for parts in episodes]
    kept = [episodes[k] for k in best_of(returns, share)]
    scale = float(np.concatenate([_to_go(p["reward"], gamma) for p in kept]).std())
    scale = scale if scale > 1e-6 else 1.0

    def tensor(name: str) -> Tensor:
        joined = np.concatenate([parts[name] for parts in kept])
        return torch.from_numpy(joined.astype(np.float32))

    steps = StepBatch(
        observation=tensor("observation"),
        action=tensor("action").clamp(-1.0, 1.0),
        reward=tensor("reward") / scale,
        next_observation=tensor("next_observation"),
        next_action=tensor("next_action").clamp(-1.0, 1.0),
        not_done=tensor("not_done"),
    )
    return Dataset(steps, scale)


def _episodes(files: Sequence[Path]) -> Iterator[tuple[Path, Episode]]:
    for path in files:
        for episode in episodes_of(path, NEEDED):
            if len(episode):
                yield path, episode


def _seat_of(path: Path, episode: Episode, seat: int, size: int) -> dict[str, Array]:
    """Return the steps of a seat in an episode."""
    columns, where = episode.columns, f"{path}: episode {episode.index}"
    names = ("observation",) if "observation" in columns else GOALS
    if not all(name in columns for name in names):
        raise ValueError(f"{where}: there are no observations in the recording")
    parts = [np.concatenate([episode.first[n][None], columns[n]]) for n in names]
    shown = np.concatenate(parts, -1)
    if shown.shape[2] != size:
        raise ValueError(
            f"{where}: observations have {shown.shape[2]} elements, but those of the "
            f"scenario have {size}; record it again with this version"
        )
    if seat >= shown.shape[1]:
        raise ValueError(f"{where}: there is no seat {seat}")
    action = columns["action"][:, seat]
    return {
        "observation": shown[:-1, seat],
        "next_observation": shown[1:, seat],
        "action": action,
        "next_action": np.concatenate([action[1:], action[-1:]]),
        "reward": columns["reward"][:, seat],
        "not_done": 1.0 - columns["terminated"],
    }


def _to_go(reward: Array, gamma: float) -> Array:
    """Return the discounted returns (T,) that follow each step of an episode."""
    returns = np.zeros(len(reward))
    ahead = 0.0
    for t in range(len(reward) - 1, -1, -1):
        ahead = reward[t] + gamma * ahead
        returns[t] = ahead
    return returns
