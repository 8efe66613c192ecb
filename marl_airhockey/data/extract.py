"""Extraction of puck and paddle trajectories from a video of a calibrated table."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from marl_airhockey.data.files import is_recording
from marl_airhockey.data.film import episodes_without_film
from marl_airhockey.data.reader import read_recording
from marl_airhockey.hardware.camera import CameraFrame, FileSource
from marl_airhockey.hardware.camera.film import read_times
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.rig_file import rig_fields
from marl_airhockey.hardware.vision import Detector
from marl_airhockey.hardware.vision.calibration import view_trouble
from marl_airhockey.sim.contracts.camera_model import PADDLE_TOP
from marl_airhockey.sim.core.recording import FILM
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

LOOKED = 5
"""Number of frames, spread over a video, in which the tags are searched."""
SEVERAL = 0.1
"""Largest share of frames with two pucks in a video."""


@dataclass(frozen=True)
class Trajectories:
    """Trajectories from a video of N frames."""

    time: Array
    """Times (N,), s. For a recording, they count from the start of its first episode,
    without the frames between episodes."""
    puck: Array
    """Positions of the puck (N, 2), table frame, m; nan where it was not detected."""
    paddle: Array
    """Positions of the paddle's centre (N, 2), table frame, m; nan where it was not
    detected."""
    table: str
    """Name of the table's preset."""

    def gaps(self, of: Array) -> list[tuple[float, float]]:
        """Return start and end, s, of the gaps in positions (N, 2) of a body."""
        unseen = np.isnan(of[:, 0]).astype(np.int8)
        edges = np.diff(np.concatenate([[0], unseen, [0]]))
        # A gap lasts from the last frame before it to the first frame after it.
        begins = np.maximum(np.flatnonzero(edges == 1) - 1, 0)
        ends = np.minimum(np.flatnonzero(edges == -1), len(self.time) - 1)
        times = zip(self.time[begins].tolist(), self.time[ends].tolist(), strict=True)
        return list(times)

    def write(self, path: Path) -> None:
        """Write a CSV file with a row per frame for `airhockey fit-table`.

        Cells of a body that was not detected are empty.
        """
        partial = path.with_suffix(".part")
        with partial.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["t", "x", "y", "paddle_x", "paddle_y"])
            for when, *places in np.column_stack([self.time, self.puck, self.paddle]):
                cells = ["" if np.isnan(x) else f"{x:.5f}" for x in places]
                rows.writerow([f"{when:.4f}", *cells])
        partial.rename(path)


def extract(path: Path, rig: Rig | None = None) -> Trajectories:
    """Return the trajectories in a video, or in a recording with a video.

    Args:
        path: Path of a video, or folder of a recording.
        rig: Rig of the table; None for the one in the recording.

    Raises:
        ValueError: There is no video, no rig, or no body in the video; the camera was
            moved since its calibration; or there are two pucks.
    """
    recorded = path.parent if path.name == FILM else path
    times: Array | None = None
    if is_recording(recorded):
        path, own, times = _recorded(recorded)
        rig = rig or own
    if rig is None:
        raise ValueError(
            f"{path}: the rig of the table is unknown; add --rig FILE, or give a "
            "recording that contains it"
        )
    table, view = TABLES[rig.table], rig.view
    if rig.paddle is None:
        raise ValueError(
            "the rig has no colour of the paddle; calibrate again and click the paddle"
        )
    half = float(table.size[0]) / 2, float(table.size[1]) / 2
    puck = Detector(view, rig.puck, table.puck_radius, half, readout=rig.readout)
    paddle = Detector(view, rig.paddle, table.paddle_radius, half, PADDLE_TOP)
    _check_view(path, rig)
    rows: list[tuple[float, Array, Array]] = []
    several = 0
    for frame in _pictures(path):
        pucks, paddles = puck.find_all(frame), paddle.find(frame)
        several += len(pucks) > 1
        unseen = np.full(2, np.nan)
        place = pucks[0].place if len(pucks) == 1 else unseen
        rows.append((frame.taken, place, paddles.place if paddles else unseen))
    if not any(np.isfinite([*row[1], *row[2]]).any() for row in rows):
        raise ValueError(
            f"{path}: no frame shows a puck or a paddle; expected a video of the rig's "
            "table, in the light of its calibration"
        )
    if several > SEVERAL * len(rows):
        raise ValueError(
            f"{path}: {several} of {len(rows)} frames show two pucks; record one puck"
        )
    taken, places, moving = (np.array(column) for column in zip(*rows, strict=True))
    if times is not None:
        count = min(len(times), len(taken))
        taken, places, moving = times[:count], places[:count], moving[:count]
    shown = np.isfinite(taken)
    return Trajectories(taken[shown], places[shown], moving[shown], rig.table)


def _recorded(path: Path) -> tuple[Path, Rig | None, Array]:
    """Return the video of a recording, its rig, and the times of its frames.

    The times (N,), s, count from the start of the first episode. They are nan for
    frames outside of all episodes.
    """
    recording, video = read_recording(path), path / FILM
    if not video.exists():
        raise ValueError(
            f"{path}: it was recorded without a video (teleop --record-video)"
        )
    whole = [episode for episode in recording.episodes if len(episode)]
    if not whole or "device.moment" not in whole[0].columns:
        raise ValueError(f"{path}: no step has a frame")
    taken = read_times(video)
    played = np.zeros(len(taken), np.bool_)
    cut = episodes_without_film(path, recording.episodes)
    for words in cut.values():
        warnings.warn(f"{words}; left out", RuntimeWarning, stacklevel=3)
    whole = [episode for episode in whole if episode.index not in cut]
    if not whole:
        raise ValueError(f"{path}: frames are missing in every episode")
    for episode in whole:
        moments = episode.columns["device.moment"]
        played |= (taken >= moments[0]) & (taken <= moments[-1])
    first = whole[0].columns
    began = first["device.moment"][0] - first["state.time"][0]
    times = np.where(played, taken - began, np.nan)
    given = recording.head.get("rig")
    rig = None
    if given is not None:
        rig = Rig.from_fields(path, rig_fields(path, given, "table"))
    return video, rig, times


def _pictures(path: Path) -> Iterator[CameraFrame]:
    """Yield the frames of a video; their times, s, count from the first frame."""
    source = FileSource(path, realtime=False)
    source.open()
    try:
        while (frame := source.read()) is not None:
            yield frame
    finally:
        source.close()


def _check_view(path: Path, rig: Rig) -> None:
    """Check that the video shows the table in the same view as the rig's camera.

    Raises:
        ValueError: The video has no frames, or another view.
    """
    pictures = [frame.image for frame in _spread(path)]
    if not pictures:
        raise ValueError(f"{path}: the video has no frames")
    trouble = view_trouble(rig.view, pictures, rig.known_tags)
    if trouble:
        raise ValueError(f"{path}: {trouble}")


def _spread(path: Path) -> list[CameraFrame]:
    """Return some frames, spread over a video."""
    capture = cv2.VideoCapture(str(path))
    count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    capture.release()
    # The number of frames is unknown if writing the video was interrupted.
    every = max(count // LOOKED, 1) if count > 0 else 15
    found: list[CameraFrame] = []
    for frame in _pictures(path):
        if frame.number % every == 0:
            found.append(frame)
        if len(found) == LOOKED:
            break
    return found
