"""Compare simulated frames of a camera with those of the virtual lab's camera.

    python scripts/bench/camera_images.py --out docs/data/camera_images.json \
        --image docs/images/camera_observations.png

The bodies are at random positions and have random velocities. The frame of the lab is
the mean of six, so that it has little noise. The centre of the puck is that of its
colour. The arm does not hide it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from PIL import Image

import marl_airhockey as ah
from marl_airhockey.hardware.calibration.lab_rig import lab_rig
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import Seen, TableCamera, lab_view
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.table.overlay import cropped
from marl_airhockey.types import Array

SETUP = LabSetup()
TABLE, OPTIONS = SETUP.geometry, {"table": SETUP.table}
SIZE, SHOTS, SCALE = 84, 6, 5
PUCK_LOW, PUCK_HIGH = (-0.3, -0.38), (0.9, 0.38)
PADDLE_LOW, PADDLE_HIGH = (-0.8, -0.3), (-0.5, 0.3)
"""Ranges of the positions, m. In them, the arm does not hide the puck."""


def red(image: Array) -> Array:
    """Return the amount of the puck's colour (H, W) in an image."""
    signed = image.astype(float)
    amount: Array = (signed[..., 0] - signed[..., 1:].max(-1) - 20.0).clip(0.0)
    return amount


def centre(amount: Array) -> Array:
    """Return the centre (2,), px, of an amount (H, W)."""
    y, x = np.mgrid[: amount.shape[0], : amount.shape[1]]
    at: Array = np.array([(amount * x).sum(), (amount * y).sum()]) / amount.sum()
    return at


def pair(rig: Path, camera: TableCamera, rng: np.random.Generator) -> list[Array]:
    """Return the frame of the lab and the simulated frame of a random situation."""
    puck, paddle = (
        rng.uniform(low, high)
        for low, high in ((PUCK_LOW, PUCK_HIGH), (PADDLE_LOW, PADDLE_HIGH))
    )
    fast, slow = rng.normal(0.0, 1.0, 2), rng.normal(0.0, 0.3, 2)
    shots = [camera.photograph(Seen(puck, fast, paddle, slow), k) for k in range(SHOTS)]
    mean = np.mean(shots, 0).round().astype(np.uint8)
    window = Rig.load(rig).camera_model.window(TABLE)
    lab = cropped(mean, window, SIZE)[..., ::-1]
    form = f"camera:size={SIZE},colour=rgb,frames=1,rig={rig}"
    world = ah.make_world("strike", observe=form, options=OPTIONS)
    world.reset(0)
    images = world.observer.images[form]
    moving = images.collect(*world.observer.pictured(world.sensed, world.memory, form))
    moving.frames[0, 0] = [(*paddle, *slow, 0.0), (*puck, *fast, 0.0)]
    drawn = images.draw(moving, np.zeros(1, np.int64))
    assert isinstance(drawn, dict)
    return [lab, drawn["pixels"][0, 0]]


def main(
    out: Annotated[Path, typer.Option(help="JSON file of the errors.")],
    image: Annotated[Path | None, typer.Option(help="PNG file of a pair.")] = None,
    count: Annotated[int, typer.Option(help="Number of situations.")] = 100,
) -> None:
    """Calibrate the lab, and compare the frames of random situations."""
    rng = np.random.default_rng(0)
    with lab_rig() as rig:
        base = np.array(Rig.load(rig).camera_model.base)
        camera = TableCamera(TABLE, lab_view(TABLE), base)
        pairs = [pair(rig, camera, rng) for _ in range(count)]
    levels = [np.abs(a.astype(float) - b) for a, b in pairs]
    shifts = [np.linalg.norm(np.subtract(*map(centre, map(red, p)))) for p in pairs]
    masses = [red(b).sum() / red(a).sum() for a, b in pairs]
    row = {
        "situations": count,
        "size": SIZE,
        "mean": round(float(np.mean(levels)), 2),
        "quantile_98": round(float(np.quantile(levels, 0.98)), 1),
        "puck_centre_px": round(float(np.mean(shifts)), 3),
        "puck_centre_most_px": round(float(np.max(shifts)), 3),
        "puck_amount": round(float(np.mean(masses)), 3),
    }
    out.write_text(json.dumps(row, indent=1) + "\n")
    print(json.dumps(row))
    if image is not None:
        gap = np.full((SIZE, 2, 3), 255, np.uint8)
        both = np.hstack([pairs[0][0], gap, pairs[0][1]])
        large = both.repeat(SCALE, 0).repeat(SCALE, 1)
        Image.fromarray(large).save(image, optimize=True)


if __name__ == "__main__":
    typer.run(main)
