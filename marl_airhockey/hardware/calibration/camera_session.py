"""Steps of a calibration that are common to all cameras."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from marl_airhockey.hardware.camera import Camera, CameraFrame
from marl_airhockey.hardware.vision import Colour, Detector
from marl_airhockey.hardware.vision.boards import (
    LEAST_VIEWS,
    find_board,
    lens_from_boards,
)
from marl_airhockey.hardware.vision.calibration import (
    find_tags,
    view_from_clicks,
    view_from_tags_and_edges,
)
from marl_airhockey.hardware.vision.edges import refine_corners
from marl_airhockey.hardware.vision.lens import CameraView, Lens
from marl_airhockey.sim.contracts.camera_model import PADDLE_TOP
from marl_airhockey.types import Array

AVERAGED = 6
"""Number of frames over which corners and positions are averaged."""

Needed = TypeVar("Needed")


@dataclass
class FoundByCamera:
    """Results so far of the steps that need only a camera."""

    boards: list[tuple[Array, Array]] = field(default_factory=list)
    """Corners of the board and their numbers, for each image."""
    lens: Lens | None = None
    corners: list[tuple[float, float]] = field(default_factory=list)
    """Clicked corners of the field, px, in the order of `Table.vertices`."""
    view: CameraView | None = None
    tags: dict[int, Array] = field(default_factory=dict)
    """Corners (4, 2) of the tags by number, field frame, m."""
    paddle: Colour | None = None


class CameraSession:
    """Calibration session of one camera over one field.

    Args:
        camera: Open camera over the field.
        corners: Corners (n, 2) of the field, counter-clockwise, field frame, m.
        radius: Radius of the paddle on the field, m.
        path: Path of the rig's file.
        measured: Measured corners (4, 2) of tags by number, field frame, m; None to
            find the view by clicks and the field's edges alone.
    """

    def __init__(
        self,
        camera: Camera,
        corners: Array,
        radius: float,
        path: Path,
        measured: Mapping[int, Array] | None = None,
    ) -> None:
        self._camera, self._path, self._measured = camera, path, measured
        self._corners, self._radius = np.asarray(corners), radius
        self._busy = threading.Lock()
        self.found = FoundByCamera()
        self.saved = ""
        """Path of the written file; "" before."""
        self.orders: dict[str, Callable[..., None]] = {
            "board": self.take_board,
            "lens": self.solve_lens,
            "corner": self.click_corner,
            "clear": self.clear_corners,
            "table": self.solve_table,
            "paddle": self.click_paddle,
            "save": self.save,
        }
        """Functions of the commands, by name."""

    def do(self, order: str, x: float = 0.0, y: float = 0.0) -> None:
        """Execute a command.

        Args:
            order: Name of the command, see `orders`.
            x: Column of a click, px.
            y: Row of a click, px.

        Raises:
            ValueError: The command is unknown or fails.
        """
        if order not in self.orders:
            raise ValueError(
                f"{order!r} is unknown; expected one of {', '.join(self.orders)}"
            )
        with self._busy:
            if order in ("corner", "puck", "block", "paddle"):
                self.orders[order](float(x), float(y))
            else:
                self.orders[order]()

    # Steps.

    def take_board(self) -> None:
        """Take an image of the ChArUco board.

        Raises:
            ValueError: Too few corners of the board are seen.
        """
        seen = find_board(self._frame().image)
        if seen is None:
            raise ValueError(
                "the board is not seen; hold it nearer or less tilted, or add light"
            )
        self.found.boards.append(seen)

    def solve_lens(self) -> None:
        """Find the lens from the images of the board."""
        height, width = self._frame().image.shape[:2]
        self.found.lens = lens_from_boards(self.found.boards, (width, height))

    def click_corner(self, x: float, y: float) -> None:
        """Add a click on the next corner of the table."""
        if len(self.found.corners) == len(self._corners):
            raise ValueError("all corners are clicked; clear them to click again")
        self.found.corners.append((x, y))

    def clear_corners(self) -> None:
        """Forget the clicked corners."""
        self.found.corners.clear()

    def solve_table(self) -> None:
        """Find the camera's view and the corners of the tags."""
        lens = need(self.found.lens, "the lens")
        images = [frame.image for frame in self._frames(AVERAGED)]
        seen = [find_tags(image) for image in images]
        steady = set(seen[0]).intersection(*seen[1:])
        tags = {k: np.mean([each[k] for each in seen], axis=0) for k in steady}
        mean, count = np.mean(images, axis=0).astype(np.uint8), len(self._corners)
        if self._measured is not None:
            view = view_from_tags_and_edges(
                tags, self._measured, mean, self._corners, lens
            )
        elif len(self.found.corners) < count:
            raise ValueError(f"click all {count} corners of the playing field first")
        else:
            fine = refine_corners(mean, np.array(self.found.corners), lens)
            view = view_from_clicks(fine, self._corners, lens)
        self.found.view = view
        self.found.tags = {k: view.to_table(four) for k, four in tags.items()}

    def click_paddle(self, x: float, y: float) -> None:
        """Take the paddle's colour from a clicked pixel."""
        self.found.paddle = Colour.around(self._frame().image, (x, y))

    def save(self) -> None:
        """Write the rig's file."""
        self._write()
        self.saved = str(self._path)

    def _write(self) -> None:
        raise NotImplementedError

    # State for the page.

    def state(self) -> dict[str, Any]:
        """Return the results so far for the page: lengths in mm, errors in px."""
        found = self.found
        return {
            "boards": len(found.boards),
            "boards_needed": LEAST_VIEWS,
            "lens": found.lens and round(found.lens.residual, 2),
            "corners": len(found.corners),
            "corners_needed": 0 if self._measured else len(self._corners),
            "table": found.view and round(found.view.residual, 2),
            "tags": sorted(found.tags),
            "paddle": found.paddle and found.paddle.hue,
            "saved": self.saved,
            "camera": self._camera.trouble,
        }

    def picture(self) -> bytes:
        """Return the newest frame as JPEG, with the results drawn over it.

        Raises:
            RuntimeError: There is no frame yet.
        """
        frame = self._camera.newest
        if frame is None:
            raise RuntimeError(self._camera.trouble or "camera: no frame yet")
        image, found = frame.image.copy(), self.found
        for four in find_tags(image).values():
            _outline(image, four, (0, 200, 0))
        for x, y in found.corners:
            cv2.drawMarker(image, (round(x), round(y)), (0, 0, 255))
        if found.view is not None:
            flat = np.column_stack([self._corners, np.zeros(len(self._corners))])
            _outline(image, found.view.project(flat), (255, 140, 90))
            for detector in self._detectors():
                seen = detector.find(frame)
                if seen is not None:
                    x, y = np.round(seen.pixel).astype(int)
                    cv2.drawMarker(image, (x, y), (0, 255, 255), markerSize=30)
        return bytes(cv2.imencode(".jpg", image)[1].tobytes())

    # Devices.

    def _detectors(self) -> list[Detector]:
        """Return the detectors of all clicked objects."""
        return [] if self.found.paddle is None else [self._paddle_detector()]

    def _detector(self, colour: Colour, radius: float, height: float) -> Detector:
        half_x, half_y = (float(x) for x in np.ptp(self._corners, axis=0) / 2)
        view = need(self.found.view, "the table")
        return Detector(view, colour, radius, (half_x, half_y), height)

    def _paddle_detector(self) -> Detector:
        colour = need(self.found.paddle, "the paddle's colour")
        return self._detector(colour, self._radius, PADDLE_TOP)

    def _frame(self) -> CameraFrame:
        return self._frames(1)[0]

    def _frames(self, count: int) -> list[CameraFrame]:
        """Return the next frames.

        Raises:
            ValueError: No frames arrive.
        """
        newest = self._camera.newest
        frames: list[CameraFrame] = []
        while len(frames) < count:
            last = frames[-1] if frames else newest
            frame = self._camera.next(last.number if last else -1)
            if frame is None:
                raise ValueError(self._camera.trouble or "camera: no frames")
            frames.append(frame)
        return frames


def need(what: Needed | None, name: str) -> Needed:
    """Return a result of an earlier step.

    Args:
        what: Result; None before that step.
        name: Name of the result, for messages.

    Raises:
        ValueError: The result is missing.
    """
    if what is None:
        raise ValueError(f"{name} is missing; complete its step first")
    return what


def _outline(image: Array, points: Array, colour: tuple[int, int, int]) -> None:
    pixels = np.round(points * 16).astype(np.int32)
    cv2.polylines(image, [pixels], True, colour, 1, cv2.LINE_AA, 4)
