"""Recorder of matches: what it has written survives a kill of the process.

An episode is a file of `core.recording`, whose head names the players. The pictures of
a camera are in a video of the same name beside it.
"""

from __future__ import annotations

import datetime
import time
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.core.blocks import Columns
from marl_airhockey.core.recording import SUFFIX, RecordingWriter
from marl_airhockey.data.columns import head_of, notes_of, step_columns
from marl_airhockey.devices.camera import Camera, Film
from marl_airhockey.devices.camera.film import SUFFIX as FILM_SUFFIX
from marl_airhockey.play.live_match import LiveMatch


class Recorder:
    """Writer of the episodes of a match, a file each.

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
        """Path of the last file."""

    def begin(self, match: LiveMatch, players: list[dict[str, Any]]) -> Path:
        """Begin a file and return its path.

        Args:
            match: whose first step of an episode has been made.
            players: by seat: driver, person's pseudonym, consent.
        """
        self.end(match, "cut off")
        now = datetime.datetime.now(datetime.UTC)
        stamp = now.strftime("%Y%m%d-%H%M%S-%f")
        name = f"{stamp}-{match.world.scenario.name}{SUFFIX}"
        path = self.path = self._folder / name
        head = {
            **head_of(match.world, match.keywords),
            "players": players,
            "handicap": vars(match.drivers.handicap),
            "study": self.notes,
        }
        if self._camera is not None:
            film = path.with_suffix(FILM_SUFFIX)
            self._film = Film(self._camera, film)
            head["film"] = film.name
        self._writer = RecordingWriter(path, head)
        self._writer.begin(notes_of(match.world), _only(match.first))
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
        row |= self._pictured()
        self._writer.add(row)

    def end(self, match: LiveMatch, reason: str) -> None:
        """Write how the episode ended and close the file, if one is open."""
        if self._writer is None:
            return
        self._writer.end({"reason": reason, "steps": match.ticks})
        self._writer.close()
        self._writer = None
        if self._film is not None:
            self._film.close()
            self._film = None

    @property
    def trouble(self) -> str:
        """What is missing in the video that is being written; "" if nothing is."""
        return self._film.trouble if self._film is not None else ""

    def _pictured(self) -> Columns:
        """Return the number of the film's newest picture, and when it was taken, s.

        Before the first the number is -1. Times are of the monotonic clock, as that of
        the state is, ``device.moment``.
        """
        if self._film is None:
            return {}
        last = self._film.last
        number, taken = last if last is not None else (-1, float("nan"))
        return {"frame": np.array(number, np.int64), "frame_taken": np.array(taken)}


def _only(columns: Columns) -> Columns:
    """Return the columns of the only world."""
    return {name: value[0] for name, value in columns.items()}
