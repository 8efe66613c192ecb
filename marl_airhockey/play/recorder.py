"""Recorder of matches; written steps survive the end of the process.

Each episode is a recording, see `core.recording`, with the players in its metadata. It
can contain the video of a camera. A full disk ends a recording, but not the match.
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
from marl_airhockey.rollouts.columns import (
    episode_notes,
    head_of,
    of_single_world,
    step_columns,
)
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import FILM


class Recorder:
    """Writer of a recording for each episode of a match.

    Args:
        folder: Folder of the recordings, which is created if it does not exist.
        camera: Camera whose video is recorded, too; None for no video.
        keep: Largest number of recordings of this recorder; the oldest are deleted.
            None for no limit.

    Raises:
        ValueError: The folder cannot be created.
    """

    def __init__(
        self, folder: Path, camera: Camera | None = None, keep: int | None = None
    ) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--record {folder}: {error.strerror}") from error
        # Load slow libraries now, not in the first step of a match.
        require("pyarrow", EXTRA)
        warm_up()
        if camera is not None:
            require("av", "video")
            import av  # noqa: F401

        self._folder, self._camera = folder, camera
        self._film: Film | None = None
        self._keep, self._kept = keep, deque[Path]()
        self.notes: dict[str, Any] = {}
        """Value of the key "study" of the metadata."""
        self._writer: RecordingWriter | None = None
        self.path: Path | None = None
        """Path of the last recording."""
        self.failure = ""
        """Reason why the last episode is not recorded completely; "" if it is."""

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
        """Start a recording.

        Args:
            match: Match after the first step of an episode.
            players: Driver, and pseudonym and consent of the person, by seat.
            devices: Input device, window and frame rate of each page, by seat.
        """
        self.end(match, "cut off")
        self.failure = ""
        path = self.path = new_recording(self._folder, match.world.scenario.name)
        head = {
            **head_of(match.world, match.keywords),
            "players": players,
            "policies": match.drivers.digests,
            "devices": devices,
            "study": self.notes,
        }
        with self._giving_up():
            self._writer = RecordingWriter(path, head)
            self._kept.append(path)
            if self._camera is not None:
                self._film = Film(self._camera, path / FILM)
            self._writer.begin(
                of_single_world(match.first), *episode_notes(match.world)
            )

    def step(self, match: LiveMatch, **pages: Any) -> None:
        """Add the last step of a match.

        Args:
            match: Match after the step.
            pages: Columns with the input of pages, arrays by seat, see `Seats.columns`.
        """
        if self._writer is None or match.result is None:
            return
        row = {**of_single_world(step_columns(match.world)), **pages}
        row["clock"] = np.array(time.time())
        if self._film is not None:
            row |= of_single_world(film_columns(self._film))
        with self._giving_up():
            self._writer.add(row)

    def end(self, match: LiveMatch, reason: str) -> None:
        """Write the reason for the end and close the recording, if one is open."""
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
        """End the recording, but not the match, after an error of the disk."""
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
        """Error of the video that is being written; "" for none."""
        return self._film.trouble if self._film is not None else ""
