"""Measure the vision of the real table on images with known ground truth.

    python scripts/bench/vision.py --seconds 60

A puck moves over the table of the virtual lab. It hits rails and a paddle that moves to
and fro. The lab's camera takes images of it, with lens, noise, blur, shadows and the
arm. For each method of calibrating the camera the script prints

* the position error of the puck, where at least half of it is visible,
* the error of the filter's velocity at the time of each image,
* the CPU time of finding the puck in an image.

With --marked the puck has a bar. The script then also prints the error of its
orientation, and the error of the filter's spin. --out writes the figures as JSON.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from marl_airhockey.hardware.camera import CameraFrame
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import (
    Seen,
    TableCamera,
    lab_view,
    tag_places,
)
from marl_airhockey.hardware.lab.world import RATE, LabWorld
from marl_airhockey.hardware.table.tracker import Tracker
from marl_airhockey.hardware.vision import Colour, Detector, Sighting
from marl_airhockey.hardware.vision.calibration import (
    find_tags,
    tag_corners,
    view_from_clicks,
    view_from_tags,
)
from marl_airhockey.hardware.vision.edges import refine_corners
from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.sim.contracts.camera_model import BEHIND
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.types import Array

SERVE = 5.0
"""Time after which the puck is re-served, s."""
CLICK = 1.5
"""Standard error of a click, px."""


class Shot(NamedTuple):
    """Image with its ground truth."""

    time: float
    """Time of the image, s."""
    puck: Array
    """Position of the puck, m, (2,)."""
    velocity: Array
    """Velocity of the puck, m/s, (2,)."""
    picture: Array
    """Image, (H, W, 3)."""
    angle: float
    """Orientation of the puck, rad."""
    spin: float
    """Angular velocity of the puck, rad/s."""


class Sweep:
    """Paddle that moves to and fro over its workspace."""

    def __init__(self, setup: LabSetup) -> None:
        self._home, self._size = setup.home, np.array([0.10, 0.25])

    def at(self, now: float) -> tuple[Array, Array]:
        """Return position, m, and velocity, m/s, at a time, s."""
        rate = np.array([1.9, 1.3])
        place = self._home + self._size * np.sin(rate * now)
        return place, self._size * rate * np.cos(rate * now)


def calibrations(camera: TableCamera, setup: LabSetup) -> dict[str, CameraView]:
    """Return the views of the camera by the method of their calibration."""
    table, true = setup.geometry, lab_view(setup.geometry)
    away = Seen(None, np.zeros(2), setup.home, np.zeros(2))
    images = [camera.photograph(away, k) for k in range(6)]
    seen = [find_tags(image) for image in images]
    steady = set(seen[0]).intersection(*seen[1:])
    tags = {k: np.mean([each[k] for each in seen], axis=0) for k in steady}
    known = {k: tag_corners(place) for k, place in tag_places(table).items()}
    corners = np.asarray(table.vertices)
    flat = np.column_stack([corners, np.zeros(len(corners))])
    noise = np.random.default_rng(0).normal(0.0, CLICK, corners.shape)
    clicks = true.project(flat) + noise
    mean = np.mean(images, axis=0).astype(np.uint8)
    fine = refine_corners(mean, clicks, true.lens)
    return {
        "tags of measured places": view_from_tags(tags, known, true.lens),
        "four clicks, refined by edges": view_from_clicks(fine, corners, true.lens),
        "four clicks alone": view_from_clicks(clicks, corners, true.lens),
    }


def film(setup: LabSetup, seconds: float, rate: float) -> list[Shot]:
    """Return the images of the camera.

    Args:
        setup: Setup of the lab.
        seconds: Duration, s.
        rate: Number of images per second.
    """
    edge = -float(setup.geometry.offsets[0])
    base = np.array([edge - BEHIND, 0.0])
    view = lab_view(setup.geometry)
    camera = TableCamera(setup.geometry, view, base, marked=setup.marked)
    world, sweep = LabWorld(setup), Sweep(setup)
    rng, every = np.random.default_rng(1), round(RATE / rate)
    shots = []
    for k in range(round(seconds * RATE)):
        now = (k + 1) / RATE
        if k % round(SERVE * RATE) == 0:
            place = rng.uniform([0.0, -0.3], [0.85, 0.3])
            world.put(place, rng.uniform([-1.5, -1.0], [0.5, 1.0]), held=False)
        paddle, moving = sweep.at(now)
        world.step(paddle, moving, 0.0)
        if k % every == 0:
            turn = world.puck_angle, world.puck_spin
            seen = Seen(world.puck, world.puck_velocity, paddle, moving, *turn)
            picture = camera.photograph(seen, k)
            shots.append(Shot(now, world.puck, world.puck_velocity, picture, *turn))
    return shots


def measure(
    view: CameraView, setup: LabSetup, shots: list[Shot], colour: Colour
) -> dict[str, float]:
    """Return the errors of one view on images."""
    table = setup.geometry
    length, width = (float(x) for x in table.size / 2)
    half = length, width
    detector = Detector(view, colour, table.puck_radius, half, marked=setup.marked)
    scene = LabWorld(setup).scene
    tracker = Tracker(scene, Physics(scene.defaults, "ur5e"))
    sweep, state = Sweep(setup), scene.still_state(1)
    spent, found, last = 0.0, 0, 0.0
    place_off: list[float] = []
    velocity_off: list[float] = []
    angle_off: list[float] = []
    spins: list[tuple[float, float]] = []
    first: list[Sighting] = []
    for now, puck, velocity, picture, angle, spin in shots:
        began = time.process_time()
        sighting = detector.find(CameraFrame(picture, now, 0))
        spent += time.process_time() - began
        if sighting is not None:
            found += 1
            off = sighting.angle - angle
            angle_off.append(off - np.pi * np.round(off / np.pi))
            if sighting.share > 0.5:
                place_off.append(float(np.linalg.norm(sighting.place - puck)))
        served = now // SERVE != last // SERVE
        first = [] if served else first
        last = now
        if sighting is None:
            continue
        if len(first) < 3:
            first.append(sighting)
            if len(first) == 3:
                tracker.begin(first)
            continue
        times = now - 0.008 * np.arange(100, -1, -1)
        track = np.array([[t, *sweep.at(t)[0]] for t in times])
        tracker.fill(state, [sighting], track, now, now - 0.05)
        if now % SERVE > 0.25:
            estimate = tracker.estimate
            assert estimate is not None
            velocity_off.append(float(np.linalg.norm(estimate[2:] - velocity)))
            spins.append((spin, float(state.spin[0, 1])))
    place, speed = 1e3 * np.array(place_off), np.array(velocity_off)
    turned, (true, guess) = np.array(angle_off), np.array(spins).T
    spun = float(np.mean((guess - true) ** 2))
    return {
        "read": float(np.isfinite(turned).mean()),
        "angle": float(np.sqrt(np.nanmean(turned**2))) if setup.marked else np.nan,
        "spin_rmse": spun**0.5,
        "spin_r2": 1.0 - spun / float(true.var()),
        "found": found / len(shots),
        "mean": float(place.mean()),
        "p95": float(np.percentile(place, 95)),
        "most": float(place.max()),
        "rmse": float(np.sqrt((speed**2).mean())),
        "median": float(np.median(speed)),
        "cpu": 1e3 * spent / len(shots),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument(
        "--rate", type=float, default=60.0, help="Number of images per second."
    )
    parser.add_argument("--marked", action="store_true", help="Puck with a bar.")
    parser.add_argument("--out", type=Path, help="JSON file to write.")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    setup = LabSetup(marked=given.marked)
    shots = film(setup, given.seconds, given.rate)
    edge = -float(setup.geometry.offsets[0])
    camera = TableCamera(
        setup.geometry, lab_view(setup.geometry), np.array([edge - BEHIND, 0.0])
    )
    there = Seen(np.array([0.3, 0.0]), np.zeros(2), setup.home, np.zeros(2))
    x, y = lab_view(setup.geometry).project(np.array([[0.3, 0.0, 0.003]]))[0]
    colour = Colour.around(camera.photograph(there), (float(x), float(y)))
    print(f"{len(shots)} images, {given.rate:.0f} per second")
    found = {}
    for name, view in calibrations(camera, setup).items():
        m = found[name] = measure(view, setup, shots, colour)
        print(
            f"{name:30} found {m['found']:.1%}; position {m['mean']:.2f} mm mean, "
            f"{m['p95']:.2f} p95, {m['most']:.1f} at most; velocity {m['rmse']:.3f} "
            f"m/s RMSE, {m['median']:.3f} median; {m['cpu']:.2f} CPU-ms per image; "
            f"spin {m['spin_rmse']:.2f} rad/s RMSE, R2 {m['spin_r2']:.2f}"
        )
        if given.marked:
            print(f"  mark read {m['read']:.1%}, orientation {m['angle']:.3f} rad RMS")
    if given.out:
        rows = {
            k: {n: round(x, 4) for n, x in m.items() if np.isfinite(x)}
            for k, m in found.items()
        }
        given.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
