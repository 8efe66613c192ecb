"""Render images for the docs: every scenario in a scripted episode.

    python scripts/reproduce/pictures.py --out docs/images

The script writes ``tasks.png`` and ``games.png``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

import marl_airhockey as ah
from marl_airhockey.rollouts.play import play
from marl_airhockey.sim.render.picture import draw
from marl_airhockey.sim.render.renderer import Renderer
from marl_airhockey.types import Array

COLUMNS = 2
MOMENT = 1.9
"""Time of the image, s, unless the episode ends before."""
WIDE = 1.5
"""Ratio of length to width below which tables are rendered smaller."""


def moment(name: str, width: int) -> Array:
    """Return an image of a scenario with scripted drivers at all seats."""
    seats = ah.make_scenario(name).scene.seats
    driver = "allround" if len(seats) > 1 else "striker"
    driver = "reacher" if name.startswith("reach") else driver
    drivers = {f"paddle_{i}": driver for i in range(len(seats))}
    world = ah.make_world(name, drivers=drivers)
    world.autoreset = False
    world.reset(2)
    renderer = Renderer(world, "rgb_array", name.replace("_", " "))
    for _ in play(world):
        renderer.follow()
        if world.state.time[0] >= MOMENT:
            break
    x, y = world.scene.table.size
    return draw(renderer.frame(), width if x > WIDE * y else round(0.54 * width))


def save(path: Path, image: Array) -> None:
    """Write an image (H, W, 3) as a PNG file."""
    cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))


def sheet(pictures: list[Array], width: int) -> Array:
    """Return one image with several images in rows, on white."""
    rows = []
    for i in range(0, len(pictures), COLUMNS):
        some = pictures[i : i + COLUMNS]
        row = np.full((max(map(len, some)), COLUMNS * width, 3), 255, np.uint8)
        for k, picture in enumerate(some):
            height, wide = picture.shape[:2]
            row[:height, k * width : k * width + wide] = picture
        rows.append(row)
    return np.concatenate(rows, axis=0)


def main(
    out: Annotated[Path, typer.Option(help="Folder of the PNG files.")] = Path(
        "docs/images"
    ),
    width: Annotated[int, typer.Option(help="Width of one image, px.")] = 560,
) -> None:
    """Play all scenarios, and write one image of the tasks and one of the games."""
    out.mkdir(parents=True, exist_ok=True)
    kinds: dict[str, list[Array]] = {"tasks": [], "games": []}
    for name in ah.scenario_names():
        alone = len(ah.make_scenario(name).scene.seats) == 1
        kinds["tasks" if alone else "games"].append(moment(name, width))
    for kind, pictures in kinds.items():
        save(out / f"{kind}.png", sheet(pictures, width))


if __name__ == "__main__":
    typer.run(main)
