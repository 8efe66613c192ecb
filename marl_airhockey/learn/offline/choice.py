"""Choice of the episodes to learn from, and a summary of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.reader import read_episode_rows, read_head
from marl_airhockey.learn.offline.config import OfflineConfig


def best_of(returns: Sequence[float], share: float) -> list[int]:
    """Return the indices of the episodes with the highest returns.

    Args:
        returns: Return of each episode.
        share: Share of the episodes to choose, at least one episode.
    """
    order = np.argsort([-value for value in returns], kind="stable")
    return [int(k) for k in order[: max(round(share * len(returns)), 1)]]


def learned_from(config: OfflineConfig) -> list[str]:
    """Return lines that summarize the data of a run and warn about unusual properties.

    Raises:
        ValueError: A recording is invalid. The message names it.
    """
    files, seat = [Path(path) for path in config.data], config.seat
    rows = [row for path in files for row in read_episode_rows(path) if row["length"]]
    best = best_of([_of(row, "returns", seat) or 0.0 for row in rows], config.share)
    chosen = [rows[k] for k in best if rows]
    steps = sum(row["length"] for row in chosen)
    words = f"learning from {len(chosen)} of {len(rows)} episodes, {steps:,} steps"
    found = [_of(row, "success", seat) for row in chosen]
    success = [value for value in found if value is not None]
    if success:
        words += f", success {np.mean(success):.3f}"
    lines = [words]
    if success and not any(success):
        lines.append("none of these episodes succeeded")
    if steps < config.batch_size:
        lines.append(f"the data have fewer steps than a batch has, {config.batch_size}")
    for agent, driver in config.drivers.items():
        others = _drivers(files, int(agent.removeprefix("paddle_")), seat) - {driver}
        if others:
            lines.append(
                f"{agent} is {driver} in evaluations, but in some recordings "
                f"{', '.join(sorted(others))}; --driver {agent}=NAME selects a driver"
            )
    return lines


def _of(row: dict[str, Any], name: str, seat: int) -> float | None:
    """Return a value of a seat in a row of the episode table; None if it is missing."""
    values = row.get(name) or []
    return float(values[seat]) if seat < len(values) else None


def _drivers(files: Sequence[Path], i: int, seat: int) -> set[str]:
    """Return the names of the drivers of paddle i in recordings."""
    players = [read_head(path)["players"] for path in files]
    return {str(each[0 if i == seat else i]["driver"]) for each in players}
