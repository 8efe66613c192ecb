"""Games on disk, line by line: what is written survives a kill of the process.

An episode is a file of JSON lines: ``meta`` (with the state before the first step as
``start``), a ``step`` for every control step, and an ``end``. A file without an end was
cut off.
"""

from __future__ import annotations

import datetime
import json
import os
import platform
import time
from importlib import metadata
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from marl_airhockey.evaluation.recordings import FORMAT
from marl_airhockey.play.live_match import Court

SYNC = 1.0
"""s between two times that the file is forced onto the disk."""


class Recorder:
    """Writes the episodes of a court into a folder."""

    def __init__(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--record {folder}: {error.strerror}") from error
        self._folder = folder
        self.notes: dict[str, Any] = {}
        """What else the first line of a file says, under "study"."""
        self._file: TextIO | None = None
        self.path: Path | None = None
        """Of the last file."""
        self._synced = 0.0

    def begin(self, court: Court, players: list[dict[str, Any]]) -> Path:
        """Begin a file; ``players`` says of each seat who sits there."""
        self.end(court, "cut off")
        now = datetime.datetime.now(datetime.UTC)
        scenario = court.world.scenario.name
        stamp = now.strftime("%Y%m%d-%H%M%S-%f")
        path = self.path = self._folder / f"{stamp}-{scenario}.jsonl"
        self._file = path.open("x")
        physics = court.world.episode.physics
        self._write(
            {
                "kind": "meta",
                "format": FORMAT,
                "began": now.isoformat(),
                "options": court.keywords.get("options", {}),
                "backend": court.keywords.get("backend", "pymunk"),
                "profile": court.keywords.get("profile", "ideal"),
                "control_dt": court.world.control_dt,
                "physics": {k: float(v[0]) for k, v in physics.items()},
                "seed": int(court.world.seeds[0]),
                "episode": int(court.world.episode.number[0]),
                "players": players,
                "fairness": vars(court.fairness),
                "versions": {
                    "marl_airhockey": metadata.version("marl_airhockey"),
                    "python": platform.python_version(),
                },
                "study": self.notes,
                "court": court.describe(),
                "start": court.opening,
            }
        )
        return path

    def step(self, court: Court, delays: list[float | None]) -> None:
        """Add the step that was just made; ``delays`` are round trips of seats, ms."""
        if self._file is None or court.result is None:
            return
        world, terms = court.world, court.result.terms
        self._write(
            {
                "kind": "step",
                "clock": round(time.time(), 4),
                **court.state(),
                "pad_velocities": np.round(world.state.paddle_velocity[0], 4).tolist(),
                "asked": np.round(world.action[0], 4).tolist(),
                "sent": np.round(world.command[0], 4).tolist(),
                "terms": {k: np.round(v[0], 4).tolist() for k, v in terms.items()},
                "excess": np.round(court.result.violation[0], 4).tolist(),
                "delays": delays,
            }
        )
        now = time.monotonic()
        if now - self._synced > SYNC:
            os.fsync(self._file.fileno())
            self._synced = now

    def end(self, court: Court, reason: str) -> None:
        """Close the file with how the episode ended."""
        if self._file is None:
            return
        world = court.world
        self._write(
            {
                "kind": "end",
                "reason": reason,
                "steps": court.ticks,
                "returns": np.round(world.episode.returns[0], 4).tolist(),
                "success": world.episode.success[0].tolist(),
            }
        )
        os.fsync(self._file.fileno())
        self._file.close()
        self._file = None

    def _write(self, row: dict[str, Any]) -> None:
        assert self._file is not None
        self._file.write(json.dumps(row, separators=(",", ":")) + "\n")
        # To the system: a killed process loses nothing of it.
        self._file.flush()
