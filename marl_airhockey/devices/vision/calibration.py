"""Calibration: a camera's view of a table from printed tags or from clicks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from marl_airhockey.devices.vision.lens import Lens, View
from marl_airhockey.types import Array

TAGS = cv2.aruco.DICT_4X4_50
"""Dictionary of the printed tags"""
TAG = 0.08
"""Width of a printed tag's black square, m"""
LEAST_TAGS = 4
"""Number of tags that must be seen"""
WORST = 2.0
"""Largest error of a corner, px, beyond which a calibration is refused"""
MOVED = 2.0
"""Error of the tags, px, at which a camera is not where it was calibrated"""
DARK = 40.0
"""Mean of a picture, of 255, below which it is dark"""


def tag_corners(place: Array) -> Array:
    """Return the corners (4, 2) of a tag about its middle (2,), m, as they are found.

    It lies upright in the table's frame.
    """
    half = TAG / 2
    around = np.array([(-half, half), (half, half), (half, -half), (-half, -half)])
    return np.asarray(place + around)


def find_tags(image: Array) -> dict[int, Array]:
    """Return the corners (4, 2), px, of the tags in a picture, by their numbers."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    words = cv2.aruco.getPredefinedDictionary(TAGS)
    corners, numbers, _ = cv2.aruco.ArucoDetector(words, parameters).detectMarkers(
        image
    )
    if numbers is None:
        return {}
    found = zip(numbers.ravel(), corners, strict=True)
    return {int(number): np.asarray(four[0], float) for number, four in found}


def view_from_tags(
    seen: Mapping[int, Array], known: Mapping[int, Array], lens: Lens
) -> View:
    """Return the view in which tags of known places are seen.

    Args:
        seen: corners (4, 2) by number, px, as `find_tags` returns them.
        known: corners (4, 2) by number, table frame, m, in the same order.
        lens: of the camera.

    Raises:
        ValueError: too few tags, or corners that do not fit together.
    """
    both = sorted(seen.keys() & known.keys())
    if len(both) < LEAST_TAGS:
        raise ValueError(
            f"{len(both)} of {len(known)} tags are seen, at least {LEAST_TAGS} are "
            "needed: is something in front of them, or is it too dark?"
        )
    pixels = np.concatenate([seen[k] for k in both])
    places = np.concatenate([known[k] for k in both])
    return _view(pixels, places, lens)


def view_from_clicks(pixels: Array, places: Array, lens: Lens) -> View:
    """Return the view from at least four clicked points.

    Args:
        pixels: (n, 2).
        places: (n, 2) table frame, m.
        lens: of the camera.

    Raises:
        ValueError: fewer than four, or points that do not fit together.
    """
    if len(pixels) < 4 or len(pixels) != len(places):
        raise ValueError(f"{len(pixels)} points: click at least four, in their order")
    return _view(np.asarray(pixels, float), np.asarray(places, float), lens)


def _view(pixels: Array, places: Array, lens: Lens) -> View:
    points = np.column_stack([places, np.zeros(len(places))])
    found, rotation, translation = cv2.solvePnP(
        points, pixels, *lens.arrays, flags=cv2.SOLVEPNP_IPPE
    )
    if not found:
        raise ValueError("the points lie in a line or do not fit together")
    rotation, translation = cv2.solvePnPRefineLM(
        points, pixels, *lens.arrays, rotation, translation
    )
    vector = tuple(float(x) for x in rotation.ravel())
    shift = tuple(float(x) for x in translation.ravel())
    view = View(lens, vector, shift)  # type: ignore[arg-type]
    off = np.linalg.norm(view.project(points) - pixels, axis=1)
    residual = float(np.sqrt((off**2).mean()))
    if residual > WORST:
        raise ValueError(
            f"the points fit to {residual:.1f} px, {WORST:.1f} px is allowed: is a "
            "tag not where it should be, or a point clicked in another order?"
        )
    return View(lens, vector, shift, residual)  # type: ignore[arg-type]


def view_trouble(
    view: View, pictures: Sequence[Array], known: Mapping[int, Array]
) -> str:
    """Return why pictures do not show a table as it was calibrated; "" if they do.

    Args:
        view: of the calibration.
        pictures: (H, W, 3) uint8 each, at least one.
        known: corners (4, 2) of the tags by number, table frame, m; without any,
            nothing tells whether the camera was moved.
    """
    height, width = pictures[0].shape[:2]
    if (width, height) != tuple(view.lens.size):
        return (
            f"its pictures are {width} x {height}, those of the calibrated camera "
            f"{view.lens.size[0]} x {view.lens.size[1]}; set that size, or calibrate "
            "anew"
        )
    if not known:
        return ""
    off = [moved(view, find_tags(picture), known) for picture in pictures]
    seen = [error for error in off if np.isfinite(error)]
    if not seen:
        light = float(np.mean([picture.mean() for picture in pictures]))
        dark = f", and the picture is dark (mean {light:.0f} of 255)"
        return (
            f"none of the table's tags is seen{dark if light < DARK else ''}; is this "
            "the camera over the table, are the lights on, is the lens free?"
        )
    if np.median(seen) > MOVED:
        return (
            f"the tags are {np.median(seen):.1f} px from where they were; the camera "
            "was moved or the table was: calibrate anew"
        )
    return ""


def moved(view: View, seen: Mapping[int, Array], known: Mapping[int, Array]) -> float:
    """Return by how far tags are not where a view has them, px; nan if none is seen."""
    both = sorted(seen.keys() & known.keys())
    if not both:
        return float("nan")
    places = np.concatenate([known[k] for k in both])
    points = np.column_stack([places, np.zeros(len(places))])
    off = view.project(points) - np.concatenate([seen[k] for k in both])
    return float(np.median(np.linalg.norm(off, axis=1)))
