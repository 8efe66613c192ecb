"""Recorder of matches: what it has written survives a kill of the process.

An episode is a file of JSON lines: ``meta`` (with the state before the first step as
``first_state``), a ``step`` for every control step, and an ``end``. A file without an
end was cut off.
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

from marl_airhockey.evaluation.recordings import FORMAT
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.messages import rounded
from marl_airhockey.registry import DEFAULT_BACKEND

SYNC = 1.0
"""Time between two calls of fsync, s."""


class Recorder:
    """Writer of the episodes of a match, a file each.

    Args:
        folder: is made if it does not exist.

    Raises:
        ValueError: a folder that cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--record {folder}: {error.strerror}") from error
        self._folder = folder
        self.notes: dict[str, Any] = {}
        """Value of the key "study" of the meta line."""
        self._file: TextIO | None = None
        self.path: Path | None = None
        """Path of the last file."""
        self._synced = 0.0

    def begin(self, match: LiveMatch, players: list[dict[str, Any]]) -> Path:
        """Begin a file and return its path.

        Args:
            match: whose first step of an episode has been made.
            players: by seat: driver, person's pseudonym, consent.
        """
        self.end(match, "cut off")
        now = datetime.datetime.now(datetime.UTC)
        scenario = match.world.scenario.name
        stamp = now.strftime("%Y%m%d-%H%M%S-%f")
        path = self.path = self._folder / f"{stamp}-{scenario}.jsonl"
        self._file = path.open("x")
        physics = match.world.episode.physics
        self._write(
            {
                "kind": "meta",
                "format": FORMAT,
                "began": now.isoformat(),
                "options": match.keywords.get("options", {}),
                "backend": match.keywords.get("backend", DEFAULT_BACKEND),
                "profile": match.keywords.get("profile", "ideal"),
                "control_dt": match.world.control_dt,
                "physics": {k: float(v[0]) for k, v in physics.items()},
                "seed": int(match.world.seeds[0]),
                "episode": int(match.world.episode.number[0]),
                "players": players,
                "handicap": vars(match.drivers.handicap),
                "versions": {
                    "marl_airhockey": metadata.version("marl_airhockey"),
                    "python": platform.python_version(),
                },
                "study": self.notes,
                "match": match.describe(),
                "first_state": match.first_state,
            }
        )
        return path

    def step(self, match: LiveMatch, delays: list[float | None]) -> None:
        """Add the last step.

        Args:
            match: that made it.
            delays: round trip of the page at each seat, ms; None for programs.
        """
        if self._file is None or match.result is None:
            return
        world, terms = match.world, match.result.terms
        self._write(
            {
                "kind": "step",
                "clock": round(time.time(), 4),
                **match.state(),
                "paddle_velocities": rounded(world.state.paddle_velocity[0]),
                "action": rounded(world.action[0]),
                "command": rounded(world.command[0]),
                "terms": {k: rounded(v[0]) for k, v in terms.items()},
                "violation": rounded(match.result.violation[0]),
                "delays": delays,
            }
        )
        now = time.monotonic()
        if now - self._synced > SYNC:
            os.fsync(self._file.fileno())
            self._synced = now

    def end(self, match: LiveMatch, reason: str) -> None:
        """Write the end line and close the file, if one is open."""
        if self._file is None:
            return
        world = match.world
        self._write(
            {
                "kind": "end",
                "reason": reason,
                "steps": match.ticks,
                "returns": rounded(world.episode.returns[0]),
                "success": world.episode.success[0].tolist(),
            }
        )
        os.fsync(self._file.fileno())
        self._file.close()
        self._file = None

    def _write(self, row: dict[str, Any]) -> None:
        assert self._file is not None
        self._file.write(json.dumps(row, separators=(",", ":")) + "\n")
        # Handed to the operating system: a killed process loses nothing of it.
        self._file.flush()
