"""Recorder of matches: what it has written survives a kill of the process.

An episode is a recording, see `core.recording`, whose head names the players. The
frames of a camera are in it, too. A disk that is full ends a recording, not the match.
"""

from __future__ import annotations

import contextlib
import shutil
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.files import new_recording
from marl_airhockey.data.film import film_columns
from marl_airhockey.data.parquet import EXTRA, warm_up
from marl_airhockey.data.writer import RecordingWriter
from marl_airhockey.hardware.camera import Camera, Film
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.rollouts.columns import episode_notes, head_of, step_columns
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import FILM, Columns


class Recorder:
    """Writer of the episodes of a match, a recording each.

    Args:
        folder: Folder, which is made if it does not exist.
        camera: Camera whose pictures are kept, too; None for none.
        keep: Most recordings that are kept; then the oldest of this recorder go. None
            for all.

    Raises:
        ValueError: A folder that cannot be made.
    """

    def __init__(
        self, folder: Path, camera: Camera | None = None, keep: int | None = None
    ) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--record {folder}: {error.strerror}") from error
        # Here, and not in the first step of a match.
        require("pyarrow", EXTRA)
        warm_up()
        if camera is not None:
            require("av", "video")
            import av  # noqa: F401

        self._folder, self._camera = folder, camera
        self._film: Film | None = None
        self._keep, self._kept = keep, deque[Path]()
        self.notes: dict[str, Any] = {}
        """Value of the key "study" of the head."""
        self._writer: RecordingWriter | None = None
        self.path: Path | None = None
        """Path of the last recording."""
        self.failure = ""
        """Reason why the last episode is not recorded to its end; "" if it is."""

    @property
    def runs(self) -> bool:
        """True while an episode is being recorded."""
        return self._writer is not None

    def begin(
        self,
        match: LiveMatch,
        players: list[dict[str, Any]],
        devices: list[dict[str, Any] | None],
    ) -> None:
        """Begin a recording.

        Args:
            match: Match whose first step of an episode has been made.
            players: Driver, person's pseudonym and consent, by seat.
            devices: Input device, screen and pictures a second of each page, by seat.
        """
        self.end(match, "cut off")
        self.failure = ""
        path = self.path = new_recording(self._folder, match.world.scenario.name)
        head = {
            **head_of(match.world, match.keywords),
            "players": players,
            "policies": match.drivers.digests,
            "devices": devices,
            "handicap": vars(match.drivers.handicap),
            "study": self.notes,
        }
        with self._giving_up():
            self._writer = RecordingWriter(path, head)
            self._kept.append(path)
            if self._camera is not None:
                self._film = Film(self._camera, path / FILM)
            self._writer.begin(_only(match.first), *episode_notes(match.world))

    def step(self, match: LiveMatch, **pages: Any) -> None:
        """Add the last step.

        Args:
            match: Match that made it.
            pages: Columns of what pages do, arrays by seat, see `Seats.columns`.
        """
        if self._writer is None or match.result is None:
            return
        row = {**_only(step_columns(match.world)), **pages}
        row["clock"] = np.array(time.time())
        if self._film is not None:
            row |= _only(film_columns(self._film))
        with self._giving_up():
            self._writer.add(row)

    def end(self, match: LiveMatch, reason: str) -> None:
        """Write how the episode ended and close the recording, if one is open."""
        if self._writer is None:
            return
        with self._giving_up():
            self._writer.end(reason)
            self._writer.close()
        self._stop()
        while self._keep is not None and len(self._kept) > self._keep:
            shutil.rmtree(self._kept.popleft(), ignore_errors=True)

    @contextlib.contextmanager
    def _giving_up(self) -> Iterator[None]:
        """End the recording, but not the match, on an error of the disk."""
        try:
            yield
        except OSError as error:
            self.failure = error.strerror or str(error)
            if self._writer is not None:
                with contextlib.suppress(OSError):
                    self._writer.close()
            self._stop()

    def _stop(self) -> None:
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
