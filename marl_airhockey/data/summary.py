"""Summary of a recording: scenario, players, length, success and return."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.files import shown_name, size_of
from marl_airhockey.data.reader import read_episode_rows, read_head, step_counts


@dataclass(frozen=True)
class Summary:
    """Summary of a recording."""

    path: str
    scenario: str
    profile: str
    backend: str
    players: list[str]
    episodes: int
    steps: int
    cut_off: int
    """Number of episodes without an end."""
    success: float
    """Share of episodes in which ``paddle_0`` succeeded; nan without episodes."""
    returns: float
    """Mean return of ``paddle_0``; nan without episodes."""
    bytes: int

    def row(self) -> list[str]:
        """Return the cells of a row of the table of recordings."""
        cut = f" ({self.cut_off} interrupted)" if self.cut_off else ""
        return [
            shown_name(Path(self.path)),
            f"{self.scenario}, {self.profile}",
            ", ".join(self.players),
            *(f"{self.episodes}{cut}", str(self.steps), f"{self.success:.3f}"),
            *(f"{self.returns:.2f}", f"{self.bytes / 1e6:.1f}"),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the fields as JSON, with None for nan."""
        fields = asdict(self)
        return {k: None if value != value else value for k, value in fields.items()}


def summarize_recording(path: Path) -> Summary:
    """Read a recording and return its summary.

    Raises:
        ValueError: The folder is not a recording, or is damaged.
    """
    head, rows = read_head(path), read_episode_rows(path)
    steps = step_counts(path, len(rows))
    played = [row for row, count in zip(rows, steps, strict=True) if count]
    try:
        players = [row["person"] or row["driver"] for row in head.get("players", [])]
        success = [bool(row["success"][0]) for row in played]
        returns = [float(row["returns"][0]) for row in played]
    except (KeyError, TypeError, IndexError) as error:
        raise ValueError(f"{path}: {error} is missing or wrong") from error
    return Summary(
        path=str(path),
        scenario=head["scenario"],
        profile=str(head.get("profile", "")),
        backend=str(head.get("backend", "")),
        players=players,
        episodes=len(rows),
        steps=int(steps.sum()),
        cut_off=sum(not row["reason"] for row in rows),
        success=float(np.mean(success)) if success else float("nan"),
        returns=float(np.mean(returns)) if returns else float("nan"),
        bytes=size_of(path),
    )
