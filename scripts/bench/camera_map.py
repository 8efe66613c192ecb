"""Measure the error of a camera's map that remains after each kind of calibration.

    python scripts/bench/camera_map.py --out docs/data/camera_map.json

Each camera above the table of the virtual lab has a random pose and a random lens. The
lens is calibrated with twelve images of the board. The centres of the tags are measured
with an error of 1 mm, and the corners of the field are clicked. The puck is put on a
grid, and its detected position, averaged over three images, is compared with the true
one. The result is the systematic error in the workspace of the arm and outside of it.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import numpy as np

from marl_airhockey.hardware.camera import CameraFrame
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import Seen, TableCamera, tag_places
from marl_airhockey.hardware.vision import Colour, Detector
from marl_airhockey.hardware.vision.boards import find_board, lens_from_boards
from marl_airhockey.hardware.vision.calibration import (
    find_tags,
    tag_corners,
    view_from_clicks,
    view_from_tags,
    view_from_tags_and_edges,
)
from marl_airhockey.hardware.vision.edges import refine_corners
from marl_airhockey.hardware.vision.lens import CameraView, Lens
from marl_airhockey.sim.contracts.camera_model import BEHIND
from marl_airhockey.types import Array

SETUP = LabSetup()
TABLE = SETUP.geometry
SIZE = 640, 480
CENTRE = np.array([0.0, 0.0, 2.2])
"""Mean position of a camera, table frame, m."""
MEASURED, CLICKED = 0.001, 1.5
"""Standard errors of a measured tag, m, and of a click, px, per axis."""
STILL = np.zeros(2)
PUCK = np.array([[0.3, 0.0, 0.003]])
"""Position of the puck while its colour is clicked, m."""


def random_view(rng: np.random.Generator) -> CameraView:
    """Return the view of a camera with a random pose and a random lens."""
    focal = 602.0 * rng.uniform(0.97, 1.03)
    x, y = np.array(SIZE) / 2 + rng.normal(0.0, 5.0, 2)
    matrix = (focal, 0.0, x), (0.0, focal * rng.uniform(0.998, 1.002), y), (0, 0, 1.0)
    radial = rng.uniform((-0.2, 0.0), (0.0, 0.08)).tolist()
    lens = Lens(matrix, (*radial, *rng.normal(0.0, 5e-4, 2).tolist(), 0.0), SIZE)
    lean = np.array([np.pi, 0.0, 0.0]) + rng.normal(0.0, (0.05, 0.03, 0.03))
    rotation, _ = cv2.Rodrigues(lean)
    vector, _ = cv2.Rodrigues(rotation)
    shift = -rotation @ (CENTRE + rng.normal(0.0, 0.03, 3))
    return CameraView(lens, tuple(vector[:, 0].tolist()), tuple(shift.tolist()))


def calibrations(
    camera: TableCamera, true: CameraView, rng: np.random.Generator
) -> dict[str, CameraView]:
    """Return the views that a person finds, by the kind of calibration."""
    away, boards = Seen(None, STILL, SETUP.home, STILL), []
    for k in range(12):
        camera.show_board(k)
        boards.append(find_board(camera.photograph(away, k)))
    camera.show_board(None)
    lens = lens_from_boards([seen for seen in boards if seen is not None], SIZE)
    images = [camera.photograph(away, k) for k in range(6)]
    seen = [find_tags(image) for image in images]
    steady = set(seen[0]).intersection(*seen[1:])
    tags = {k: np.mean([each[k] for each in seen], axis=0) for k in steady}
    places = {
        k: tag_corners(place + rng.normal(0.0, MEASURED, 2))
        for k, place in tag_places(TABLE).items()
    }
    corners = np.asarray(TABLE.vertices)
    flat = np.column_stack([corners, np.zeros(len(corners))])
    clicks = true.project(flat) + rng.normal(0.0, CLICKED, corners.shape)
    mean = np.mean(images, axis=0).astype(np.uint8)
    fine = refine_corners(mean, clicks, lens)
    return {
        "tags": view_from_tags(tags, places, lens),
        "clicks and edges": view_from_clicks(fine, corners, lens),
        "tags and edges": view_from_tags_and_edges(tags, places, mean, corners, lens),
        "exact view": true,
    }


def grid() -> tuple[Array, Array]:
    """Return positions (n, 2) of the puck, m, and True for those in the workspace."""
    x, y = np.asarray(TABLE.size) / 2 - TABLE.puck_radius
    axes = np.meshgrid(np.linspace(-x, x, 15), np.linspace(-y, y, 9))
    places = np.stack(axes, -1).reshape(-1, 2)
    low, high = np.min(SETUP.seat.reach, 0), np.max(SETUP.seat.reach, 0)
    return places, ((places >= low) & (places <= high)).all(-1)


def photographs(camera: TableCamera, places: Array) -> list[list[Array]]:
    """Return three images of the puck at each place, which the arm does not hide."""
    low, high = np.min(SETUP.seat.reach, 0), np.max(SETUP.seat.reach, 0)
    found = []
    for place in places:
        side = low[1] + 0.02 if place[1] > 0 else high[1] - 0.02
        seen = Seen(place, STILL, np.array([low[0] + 0.02, side]), STILL)
        found.append([camera.photograph(seen, k) for k in range(3)])
    return found


def errors(detector: Detector, shots: list[list[Array]], places: Array) -> Array:
    """Return the mean errors (n, 2) of the detected puck, m; nan where it is hidden."""
    rows = np.full(places.shape, np.nan)
    for k, images in enumerate(shots):
        seen = [detector.find(CameraFrame(image, 0.0, 0)) for image in images]
        whole = [each.place for each in seen if each is not None and each.share > 0.9]
        if whole:
            rows[k] = np.mean(whole, axis=0) - places[k]
    return rows


def summary(rows: Array) -> dict[str, float]:
    """Return the summary of errors (n, 2) of one camera, mm."""
    size = np.linalg.norm(rows, axis=-1)
    found = {
        "median": np.nanmedian(size),
        "p95": np.nanpercentile(size, 95),
        "sd_per_axis": np.sqrt(np.nanmean(rows**2)),
    }
    return {name: 1e3 * float(value) for name, value in found.items()}


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cameras", type=int, default=10)
    parser.add_argument("--out", type=Path, help="JSON file to write.")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    places, inside = grid()
    base = np.array([-float(TABLE.offsets[0]) - BEHIND, 0.0])
    half = tuple((np.asarray(TABLE.size) / 2).tolist())
    found: dict[str, list[dict[str, float]]] = {}
    for number in range(given.cameras):
        rng = np.random.default_rng(number)
        true = random_view(rng)
        camera = TableCamera(TABLE, true, base, seed=number)
        there = camera.photograph(Seen(PUCK[0, :2], STILL, SETUP.home, STILL))
        colour = Colour.around(there, tuple(true.project(PUCK)[0].tolist()))
        shots = photographs(camera, places)
        for name, view in calibrations(camera, true, rng).items():
            detector = Detector(view, colour, TABLE.puck_radius, half)
            off = errors(detector, shots, places)
            both = ("inside", off[inside]), ("outside", off[~inside])
            row = {f"{k}_{n}": v for k, e in both for n, v in summary(e).items()}
            found.setdefault(name, []).append(row)
    rows: dict[str, dict[str, float]] = {}
    for name, cameras in found.items():
        row = rows[name] = {}
        for key in cameras[0]:
            of = [camera[key] for camera in cameras]
            ends = {"": np.median(of), "_best": min(of), "_worst": max(of)}
            row |= {key + end: round(float(x), 2) for end, x in ends.items()}
        print(
            f"{name:17} median error {row['inside_median']:.2f} mm in the workspace "
            f"(worst camera {row['inside_median_worst']:.2f}), "
            f"{row['outside_median']:.2f} ({row['outside_median_worst']:.2f}) outside; "
            f"per axis {row['inside_sd_per_axis']:.2f} mm in the workspace "
            f"({row['inside_sd_per_axis_best']:.2f} .. "
            f"{row['inside_sd_per_axis_worst']:.2f})"
        )
    if given.out:
        given.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
