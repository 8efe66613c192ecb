"""Calibration of a camera's lens by frames that show a printed ChArUco board."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from marl_airhockey.hardware.vision.lens import Lens
from marl_airhockey.types import Array

SQUARES = (7, 5)
"""Number of squares along the board and across it."""
SQUARE, MARKER = 0.036, 0.027
"""Width of a square and of the marker in it, m."""
LEAST_CORNERS, LEAST_VIEWS = 8, 8
"""Least number of corners in a frame, and least number of such frames."""
WORST = 1.0
"""Largest accepted error of the corners, px."""
TILTED = 15.0
"""Least angle between the board and the image plane in some frame, deg; boards that
face the camera fit any focal length."""
COVERED = 0.6
"""Share of the frame's width and height over which the corners must be spread."""
UNCERTAIN = 0.02
"""Largest accepted standard deviation of the focal length, as a share."""


def make_board() -> cv2.aruco.CharucoBoard:
    """Return the board that `sheets` prints."""
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    return cv2.aruco.CharucoBoard(SQUARES, SQUARE, MARKER, markers)


def find_board(image: Array) -> tuple[Array, Array] | None:
    """Return the corners (n, 2), px, of a board in a frame and their numbers (n,).

    Return None if there are fewer than `LEAST_CORNERS`.
    """
    detector = cv2.aruco.CharucoDetector(make_board())
    corners, numbers, _, _ = detector.detectBoard(image)
    if numbers is None or len(numbers) < LEAST_CORNERS:
        return None
    return np.asarray(corners, float).reshape(-1, 2), np.asarray(numbers).ravel()


def lens_from_boards(
    views: Sequence[tuple[Array, Array]], size: tuple[int, int]
) -> Lens:
    """Fit a lens to the corners of a board in several frames.

    Args:
        views: Corners and numbers in each frame, see `find_board`.
        size: Width and height of the frames, px.

    Raises:
        ValueError: There are too few frames, no lens fits the corners, or the frames do
            not determine a lens: the board is not tilted, or is only in one part of the
            image.
    """
    if len(views) < LEAST_VIEWS:
        raise ValueError(
            f"{len(views)} images of the board; take {LEAST_VIEWS} or more, with the "
            "board tilted and in all parts of the image"
        )
    positions = np.asarray(make_board().getChessboardCorners(), np.float32)
    points = [positions[numbers] for _, numbers in views]
    pixels = [corners.astype(np.float32) for corners, _ in views]
    empty = np.eye(3), np.zeros(5)
    found = cv2.calibrateCameraExtended(points, pixels, size, *empty)
    error, matrix, distortion, rotations, _, deviations = found[:6]
    if error > WORST:
        raise ValueError(
            f"the board's corners fit to {error:.2f} px, {WORST:.1f} px is allowed; "
            "make the board flat and hold it still"
        )
    _check_poses(rotations, np.concatenate(pixels), size)
    uncertain = float((deviations[:2, 0] / matrix.diagonal()[:2]).max())
    if not uncertain <= UNCERTAIN:
        raise ValueError(
            f"the focal length is uncertain by {uncertain:.1%}, {UNCERTAIN:.0%} is "
            "allowed; take more images, with the board nearer and more tilted"
        )
    rows = tuple(tuple(float(x) for x in row) for row in matrix)
    five = tuple(float(x) for x in distortion.ravel()[:5])
    return Lens(rows, five, size, float(error))  # type: ignore[arg-type]


def _check_poses(
    rotations: Sequence[Array], pixels: Array, size: tuple[int, int]
) -> None:
    """Check that the poses of the board determine a lens.

    Args:
        rotations: Rotation vectors (3,) of the board in each frame, rad.
        pixels: Corners (n, 2) in all frames, px.
        size: Width and height of the frames, px.

    Raises:
        ValueError: No board is tilted, or the corners are only in one part of the
            frame.
    """
    facing = [abs(cv2.Rodrigues(vector)[0][2, 2]) for vector in rotations]
    tilt = float(np.degrees(np.arccos(min(facing))))
    if tilt < TILTED:
        raise ValueError(
            f"the board is tilted by at most {tilt:.0f} deg in the images; tilt it "
            f"by {TILTED:.0f} to 45 deg in some of them, in different directions"
        )
    width, height = np.ptp(pixels, axis=0) / size
    if min(width, height) < COVERED:
        raise ValueError(
            f"the board was in {width:.0%} of the image's width and {height:.0%} of "
            f"its height; hold it in all parts, at least {COVERED:.0%}"
        )
