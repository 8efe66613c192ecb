"""Video of a recording: the columns that refer to its frames, and the frames."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from marl_airhockey.hardware.camera import Film
from marl_airhockey.sim.core.recording import FILM, Columns, Episode
from marl_airhockey.types import Array


def film_columns(film: Film) -> Columns:
    """Return columns (1, ...) with number and time of the newest frame of a video.

    Before the first frame the number is -1 and the time is nan. Times are in s, on the
    monotonic clock, like ``device.moment``, the time of the state.
    """
    number, taken = film.last or (-1, np.nan)
    return {"frame": np.array([number], np.int64), "frame_taken": np.array([taken])}


def episodes_without_film(path: Path, episodes: Iterable[Episode]) -> dict[int, str]:
    """Return messages about the episodes whose last frames are missing, by index.

    Args:
        path: Folder of the recording.
        episodes: Episodes of the recording.
    """
    film = path / FILM
    if not film.exists():
        return {}
    count = count_frames(film)
    gaps = {episode.index: film_gap(path, episode, count) for episode in episodes}
    return {index: words for index, words in gaps.items() if words}


def film_gap(path: Path, episode: Episode, count: int) -> str:
    """Return a message if the video ends before an episode; "" if it does not.

    Args:
        path: Folder of the recording.
        episode: Episode of the recording.
        count: Number of frames in the video.
    """
    last = int(episode.columns.get("frame", np.zeros(0)).max(initial=-1))
    if last < count:
        return ""
    return (
        f"{path}: episode {episode.index}: the video ends {last + 1 - count} frames "
        "before the episode"
    )


def count_frames(film: Path) -> int:
    """Return the number of frames in a video."""
    capture, count = cv2.VideoCapture(str(film)), 0
    while capture.grab():
        count += 1
    capture.release()
    return count


class FilmFrames:
    """Frames of a video, which are read in order.

    Args:
        path: Path of the video.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._open()

    def _open(self) -> None:
        self._capture = cv2.VideoCapture(str(self.path))
        self._number, self._image = -1, np.zeros((0, 0, 3), np.uint8)

    def picture(self, number: int) -> Array:
        """Return a frame (H, W, 3) uint8, BGR.

        Raises:
            ValueError: The video ends before the frame.
        """
        if number < self._number:
            self._open()
        while self._number < number:
            known, image = self._capture.read()
            if not known:
                raise ValueError(f"{self.path}: there is no frame {number}")
            self._number, self._image = self._number + 1, np.asarray(image)
        return self._image
