"""Summary of a recording: who played what, how long, how well."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.core.recording import RecordedEpisode, read_recording


@dataclass(frozen=True)
class Summary:
    """Summary of a file."""

    file: str
    scenario: str
    profile: str
    backend: str
    players: list[str]
    episodes: int
    steps: int
    cut_off: int
    """Number of episodes without an end"""
    success: float
    """Share of episodes in which ``paddle_0`` succeeded; nan without episodes"""
    returns: float
    """Mean return of ``paddle_0``"""
    bytes: int

    def row(self) -> list[str]:
        """Return the cells of a table."""
        cut = f" ({self.cut_off} cut off)" if self.cut_off else ""
        return [
            *(self.file, self.scenario, self.profile, ", ".join(self.players)),
            *(f"{self.episodes}{cut}", str(self.steps), f"{self.success:.3f}"),
            *(f"{self.returns:.2f}", f"{self.bytes / 1e6:.2f}"),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the fields, None for nan."""
        fields = asdict(self)
        return {k: None if value != value else value for k, value in fields.items()}


def summarize_recording(path: Path) -> Summary:
    """Read a recording and sum it up.

    Raises:
        ValueError: no recording, or one that makes no sense; names the file.
    """
    recording = read_recording(path)
    head, played = recording.head, [e for e in recording.episodes if len(e)]
    try:
        players = [row["person"] or row["driver"] for row in head.get("players", [])]
        success = [bool(_last(episode, "success")) for episode in played]
        returns = [float(_last(episode, "returns")) for episode in played]
    except (KeyError, TypeError, IndexError) as error:
        raise ValueError(f"{path}: {error} is missing or wrong") from error
    return Summary(
        file=str(path),
        scenario=head["scenario"],
        profile=str(head.get("profile", "")),
        backend=str(head.get("backend", "")),
        players=players,
        episodes=len(recording.episodes),
        steps=sum(len(episode) for episode in played),
        cut_off=sum(not episode.end for episode in recording.episodes),
        success=float(np.mean(success)) if success else float("nan"),
        returns=float(np.mean(returns)) if returns else float("nan"),
        bytes=path.stat().st_size,
    )


def _last(episode: RecordedEpisode, name: str) -> Any:
    """Return the last value of a column for ``paddle_0``."""
    return episode.columns[name][-1][0]
