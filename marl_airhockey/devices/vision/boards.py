"""Boards: a camera's lens from pictures of a printed ChArUco board."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from marl_airhockey.devices.vision.lens import Lens
from marl_airhockey.types import Array

SQUARES = (7, 5)
"""Squares of the board along and across"""
SQUARE, MARKER = 0.036, 0.027
"""Width of a square and of the marker in it, m"""
LEAST_CORNERS, LEAST_VIEWS = 8, 8
"""Corners that a picture must show to count, and pictures that must count"""
WORST = 1.0
"""Error of the corners, px, beyond which a lens is refused"""


def make_board() -> cv2.aruco.CharucoBoard:
    """Return the board that `sheets` prints."""
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    return cv2.aruco.CharucoBoard(SQUARES, SQUARE, MARKER, words)


def find_board(image: Array) -> tuple[Array, Array] | None:
    """Return corners (n, 2), px, of a board in a picture and their numbers (n,).

    None if too few are seen.
    """
    detector = cv2.aruco.CharucoDetector(make_board())
    corners, numbers, _, _ = detector.detectBoard(image)
    if numbers is None or len(numbers) < LEAST_CORNERS:
        return None
    return np.asarray(corners, float).reshape(-1, 2), np.asarray(numbers).ravel()


def lens_from_boards(
    views: Sequence[tuple[Array, Array]], size: tuple[int, int]
) -> Lens:
    """Return the lens in which boards are seen so.

    Args:
        views: of `find_board`.
        size: width and height of the pictures, px.

    Raises:
        ValueError: too few pictures, or corners that do not fit together.
    """
    if len(views) < LEAST_VIEWS:
        raise ValueError(
            f"{len(views)} pictures of the board: take {LEAST_VIEWS} or more, tilted "
            "and in all parts of the picture"
        )
    places = np.asarray(make_board().getChessboardCorners(), np.float32)
    points = [places[numbers] for _, numbers in views]
    pixels = [corners.astype(np.float32) for corners, _ in views]
    found = cv2.calibrateCamera(points, pixels, size, None, None)
    error, matrix, distortion = found[:3]
    if error > WORST:
        raise ValueError(
            f"the board's corners fit to {error:.2f} px, {WORST:.1f} px is allowed: "
            "is the sheet flat, and held still?"
        )
    rows = tuple(tuple(float(x) for x in row) for row in matrix)
    five = tuple(float(x) for x in distortion.ravel()[:5])
    return Lens(rows, five, size, float(error))  # type: ignore[arg-type]
