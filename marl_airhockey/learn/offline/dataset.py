"""Dataset: steps of one seat in recordings, as tensors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from marl_airhockey.core.recording import RecordedEpisode
from marl_airhockey.data.reader import episodes_of
from marl_airhockey.types import Array

NEEDED = ("observation", "observation.desired_goal", "action", "reward", "terminated")
"""Columns that are read"""


@dataclass(frozen=True)
class Dataset:
    """Dataset of N steps of one seat."""

    observation: Tensor
    """(N, D)"""
    action: Tensor
    """(N, 2), in -1 .. 1"""
    reward: Tensor
    """(N,), divided by `reward_scale`"""
    next_observation: Tensor
    """(N, D)"""
    going: Tensor
    """(N,) 0 where the game ended with the step, for a reason inside it; else 1"""
    reward_scale: float
    """Standard deviation of the discounted returns from all steps on"""

    def __len__(self) -> int:
        return len(self.action)

    def draw(self, count: int) -> tuple[Tensor, ...]:
        """Return ``count`` steps, drawn with replacement: all five arrays."""
        rows = torch.randint(len(self), (count,))
        arrays = (
            *(self.observation, self.action, self.reward),
            *(self.next_observation, self.going),
        )
        return tuple(x.index_select(0, rows) for x in arrays)


def load_dataset(
    files: Sequence[Path], seat: int, share: float, gamma: float, size: int
) -> Dataset:
    """Read recordings.

    Args:
        files: of them.
        seat: whose steps are taken.
        share: of the episodes that are taken, those of the highest returns.
        gamma: discount of the returns by which rewards are scaled.
        size: D, of the scenario's observation.

    Raises:
        ValueError: no steps, no observations, or ones of another size, named.
    """
    episodes = [
        _seat_of(path, episode, seat, size) for path, episode in _episodes(files)
    ]
    if not episodes:
        raise ValueError(f"{files[0]}: there are no steps in it")
    order = np.argsort([-parts["reward"].sum() for parts in episodes], kind="stable")
    kept = [episodes[k] for k in order[: max(round(share * len(episodes)), 1)]]
    scale = float(np.concatenate([_to_go(p["reward"], gamma) for p in kept]).std())
    scale = scale if scale > 1e-6 else 1.0

    def tensor(name: str) -> Tensor:
        joined = np.concatenate([parts[name] for parts in kept])
        return torch.from_numpy(joined.astype(np.float32))

    return Dataset(
        observation=tensor("observation"),
        action=tensor("action").clamp(-1.0, 1.0),
        reward=tensor("reward") / scale,
        next_observation=tensor("next_observation"),
        going=tensor("going"),
        reward_scale=scale,
    )


def _episodes(files: Sequence[Path]) -> Iterator[tuple[Path, RecordedEpisode]]:
    for path in files:
        for episode in episodes_of(path, NEEDED):
            if len(episode):
                yield path, episode


def _seat_of(
    path: Path, episode: RecordedEpisode, seat: int, size: int
) -> dict[str, Array]:
    """Return the steps of a seat in an episode."""
    columns, where = episode.columns, f"{path}: episode {episode.index}"
    if "observation" not in columns:
        kept = "goals are apart" if "observation.desired_goal" in columns else "none"
        raise ValueError(f"{where}: there are no flat observations in it ({kept})")
    shown = np.concatenate([episode.first["observation"][None], columns["observation"]])
    if shown.shape[2] != size:
        raise ValueError(
            f"{where}: observations have {shown.shape[2]} elements, the scenario's "
            f"{size}: it was recorded by another version"
        )
    if seat >= shown.shape[1]:
        raise ValueError(f"{where}: there is no seat {seat}")
    return {
        "observation": shown[:-1, seat],
        "next_observation": shown[1:, seat],
        "action": columns["action"][:, seat],
        "reward": columns["reward"][:, seat],
        "going": 1.0 - columns["terminated"],
    }


def _to_go(reward: Array, gamma: float) -> Array:
    """Return the discounted returns (T,) from each step of an episode on."""
    returns = np.zeros(len(reward))
    ahead = 0.0
    for t in range(len(reward) - 1, -1, -1):
        ahead = reward[t] + gamma * ahead
        returns[t] = ahead
    return returns
