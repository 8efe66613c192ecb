"""Recorder of matches: what it has written survives a kill of the process.

An episode is a recording, see `core.recording`, whose head names the players. The
frames of a camera are in it, too.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.core.recording import FILM, Columns
from marl_airhockey.data.columns import episode_notes, head_of, step_columns
from marl_airhockey.data.files import new_recording
from marl_airhockey.data.film import film_columns
from marl_airhockey.data.writer import RecordingWriter
from marl_airhockey.devices.camera import Camera, Film
from marl_airhockey.play.live_match import LiveMatch


class Recorder:
    """Writer of the episodes of a match, a recording each.

    Args:
        folder: is made if it does not exist.
        camera: whose pictures are kept, too; None for none.

    Raises:
        ValueError: a folder that cannot be made.
    """

    def __init__(self, folder: Path, camera: Camera | None = None) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--record {folder}: {error.strerror}") from error
        self._folder, self._camera = folder, camera
        self._film: Film | None = None
        self.notes: dict[str, Any] = {}
        """Value of the key "study" of the head."""
        self._writer: RecordingWriter | None = None
        self.path: Path | None = None
        """Path of the last recording."""

    def begin(self, match: LiveMatch, players: list[dict[str, Any]]) -> Path:
        """Begin a recording and return its path.

        Args:
            match: whose first step of an episode has been made.
            players: by seat: driver, person's pseudonym, consent.
        """
        self.end(match, "cut off")
        path = self.path = new_recording(self._folder, match.world.scenario.name)
        head = {
            **head_of(match.world, match.keywords),
            "players": players,
            "handicap": vars(match.drivers.handicap),
            "study": self.notes,
        }
        self._writer = RecordingWriter(path, head)
        if self._camera is not None:
            self._film = Film(self._camera, path / FILM)
        self._writer.begin(_only(match.first), *episode_notes(match.world))
        return path

    def step(self, match: LiveMatch, delays: list[float | None]) -> None:
        """Add the last step.

        Args:
            match: that made it.
            delays: round trip of the page at each seat, ms; None for programs.
        """
        if self._writer is None or match.result is None:
            return
        trips = np.array([np.nan if d is None else d for d in delays])
        clock = np.array(time.time())
        row = {**_only(step_columns(match.world)), "round_trip": trips, "clock": clock}
        if self._film is not None:
            row |= _only(film_columns(self._film))
        self._writer.add(row)

    def end(self, match: LiveMatch, reason: str) -> None:
        """Write how the episode ended and close the recording, if one is open."""
        if self._writer is None:
            return
        self._writer.end(reason)
        self._writer.close()
        self._writer = None
        if self._film is not None:
            self._film.close()
            self._film = None

    @property
    def trouble(self) -> str:
        """What is missing in the video that is being written; "" if nothing is."""
        return self._film.trouble if self._film is not None else ""


def _only(columns: Columns) -> Columns:
    """Return the columns of the only world."""
    return {name: value[0] for name, value in columns.items()}
