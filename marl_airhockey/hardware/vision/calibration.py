"""Calibration of a camera's view of a table by printed tags or by clicks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from marl_airhockey.hardware.vision.edges import refine_corners
from marl_airhockey.hardware.vision.lens import CameraView, Lens
from marl_airhockey.types import Array

TAGS = cv2.aruco.DICT_4X4_50
"""Dictionary of the printed tags."""
TAG = 0.08
"""Width of a printed tag's black square, m."""
LEAST_TAGS = 4
"""Least number of tags that must be seen."""
WORST = 2.0
"""Largest accepted error of a calibration's fit, px."""
EDGES = 40
"""Weight of a corner where two edges meet, relative to a corner of a tag. Of 5 to 40,
this left the smallest errors with tags that were measured to 1 mm."""
MISPLACED = 0.006
"""Distance between the measured and the seen position of a tag above which the measured
one is wrong, m."""
MOVED = 2.0
"""Error of the tags, px, above which the camera or the table has moved."""
SHIFTED = 0.002
"""Mean shift of the tags on the table above which the camera or the table has moved, m.
Without a movement it is below 0.3 mm in the virtual lab."""
DARK = 40.0
"""Mean brightness of a frame, of 255, below which it is dark."""


def tag_corners(place: Array) -> Array:
    """Return the corners (4, 2) of an upright tag in the order of `find_tags`, m.

    Args:
        place: Position (2,) of the tag's centre, table frame, m.
    """
    half = TAG / 2
    around = np.array([(-half, half), (half, half), (half, -half), (-half, -half)])
    return np.asarray(place + around)


def find_tags(image: Array) -> dict[int, Array]:
    """Return the corners (4, 2), px, of the tags in a frame, by their numbers."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    markers = cv2.aruco.getPredefinedDictionary(TAGS)
    corners, numbers, _ = cv2.aruco.ArucoDetector(markers, parameters).detectMarkers(
        image
    )
    if numbers is None:
        return {}
    found = zip(numbers.ravel(), corners, strict=True)
    return {int(number): np.asarray(four[0], float) for number, four in found}


def view_from_tags(
    seen: Mapping[int, Array], known: Mapping[int, Array], lens: Lens
) -> CameraView:
    """Fit a view to tags at known positions.

    Args:
        seen: Corners (4, 2) by number, px, as `find_tags` returns them.
        known: Corners (4, 2) by number, table frame, m, in the same order.
        lens: Lens of the camera.

    Raises:
        ValueError: There are too few tags, or no view fits the corners.
    """
    both = sorted(seen.keys() & known.keys())
    if len(both) < LEAST_TAGS:
        raise ValueError(
            f"{len(both)} of {len(known)} tags are seen, at least {LEAST_TAGS} are "
            "needed; uncover them and check the light"
        )
    pixels = np.concatenate([seen[k] for k in both])
    positions = np.concatenate([known[k] for k in both])
    return _view(pixels, positions, lens)


def view_from_tags_and_edges(
    seen: Mapping[int, Array],
    known: Mapping[int, Array],
    image: Array,
    corners: Array,
    lens: Lens,
) -> CameraView:
    """Fit a view to measured tags and to the edges of the field.

    A person measures a tag to about 1 mm. The field is known more exactly.

    Args:
        seen: Corners (4, 2) by number, px, as `find_tags` returns them.
        known: Measured corners (4, 2) by number, table frame, m, in the same order.
        image: Image (H, W, 3) uint8 of the field.
        corners: Corners (n, 2) of the field in order around it, table frame, m.
        lens: Lens of the camera.

    Raises:
        ValueError: There are too few tags, an edge is not seen, a tag is not where it
            was measured, or no view fits.
    """
    rough = view_from_tags(seen, known, lens)
    flat = np.column_stack([corners, np.zeros(len(corners))])
    fine = refine_corners(image, rough.project(flat), lens)
    both = sorted(seen.keys() & known.keys())
    pixels = np.concatenate([*(seen[k] for k in both), np.repeat(fine, EDGES, 0)])
    places = np.concatenate([*(known[k] for k in both), np.repeat(corners, EDGES, 0)])
    view = _view(pixels, places, lens)
    for k in both:
        off = float(np.linalg.norm((view.to_table(seen[k]) - known[k]).mean(0)))
        if off > MISPLACED:
            raise ValueError(
                f"tag {k} is {1e3 * off:.0f} mm from its measured position, compared "
                "with the edges of the field; measure it again, or check that the "
                "table is the one of the rig"
            )
    return view


def view_from_clicks(pixels: Array, places: Array, lens: Lens) -> CameraView:
    """Fit a view to at least four clicked points.

    Args:
        pixels: Clicked points (n, 2), px.
        places: Positions (n, 2) of these points, table frame, m.
        lens: Lens of the camera.

    Raises:
        ValueError: There are fewer than four points, or no view fits them.
    """
    if len(pixels) < 4 or len(pixels) != len(places):
        raise ValueError(f"{len(pixels)} points; click at least four, in order")
    return _view(np.asarray(pixels, float), np.asarray(places, float), lens)


def _view(pixels: Array, positions: Array, lens: Lens) -> CameraView:
    points = np.column_stack([positions, np.zeros(len(positions))])
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
    view = CameraView(lens, vector, shift)  # type: ignore[arg-type]
    off = np.linalg.norm(view.project(points) - pixels, axis=1)
    residual = float(np.sqrt((off**2).mean()))
    if residual > WORST:
        raise ValueError(
            f"the points fit to {residual:.1f} px, {WORST:.1f} px is allowed; check "
            "the positions of the tags, or the order of the clicks"
        )
    return CameraView(lens, vector, shift, residual)  # type: ignore[arg-type]


def view_trouble(
    view: CameraView, pictures: Sequence[Array], known: Mapping[int, Array]
) -> str:
    """Return the reason why frames do not fit a calibration; "" if they do.

    Args:
        view: View of the calibration.
        pictures: Images (H, W, 3) uint8, at least one.
        known: Corners (4, 2) of the tags by number, table frame, m. Without tags, a
            movement of the camera is not detected.
    """
    height, width = pictures[0].shape[:2]
    if (width, height) != tuple(view.lens.size):
        return (
            f"its images are {width} x {height}, those of the calibrated camera "
            f"{view.lens.size[0]} x {view.lens.size[1]}; set that size, or calibrate "
            "again"
        )
    if not known:
        return ""
    tags = [find_tags(picture) for picture in pictures]
    off = [moved(view, each, known) for each in tags]
    seen = [error for error in off if np.isfinite(error)]
    if not seen:
        light = float(np.mean([picture.mean() for picture in pictures]))
        dark = f", and the image is dark (mean {light:.0f} of 255)"
        return (
            f"none of the table's tags is seen{dark if light < DARK else ''}; is this "
            "the camera over the table, are the lights on, is the lens uncovered?"
        )
    shifts = [shifted(view, each, known) for each in tags if each.keys() & known.keys()]
    shift = float(np.linalg.norm(np.mean(shifts, 0)))
    if shift > SHIFTED:
        return (
            f"the tags are {1e3 * shift:.1f} mm from where they were on the table; the "
            "camera or the table was moved: calibrate again"
        )
    if np.median(seen) > MOVED:
        return (
            f"the tags are {np.median(seen):.1f} px from where they were; the camera "
            "or the table was moved: calibrate again"
        )
    return ""


def moved(
    view: CameraView, seen: Mapping[int, Array], known: Mapping[int, Array]
) -> float:
    """Return the median error of the tags' corners in a view, px; nan without tags.

    Args:
        view: View of the calibration.
        seen: Corners (4, 2) by number, px, as `find_tags` returns them.
        known: Corners (4, 2) by number, table frame, m.
    """
    both = sorted(seen.keys() & known.keys())
    if not both:
        return float("nan")
    positions = np.concatenate([known[k] for k in both])
    points = np.column_stack([positions, np.zeros(len(positions))])
    off = view.project(points) - np.concatenate([seen[k] for k in both])
    return float(np.median(np.linalg.norm(off, axis=1)))


def shifted(
    view: CameraView, seen: Mapping[int, Array], known: Mapping[int, Array]
) -> Array:
    """Return the mean shift (2,) of the tags' corners on the table, m.

    Args:
        view: View of the calibration.
        seen: Corners (4, 2) by number, px, as `find_tags` returns them.
        known: Corners (4, 2) by number, table frame, m, at least one of them seen.
    """
    both = sorted(seen.keys() & known.keys())
    places = view.to_table(np.concatenate([seen[k] for k in both]))
    off = places - np.concatenate([known[k] for k in both])
    return np.asarray(off.mean(0))
