"""Render images for the docs: every scenario in a scripted episode.

    python scripts/reproduce/pictures.py --out docs/images
    python scripts/reproduce/pictures.py --out docs/images --arm

The first command writes ``tasks.png``, ``games.png``, ``image_observations.png`` and
``set_pieces.webp``. The second one writes ``arm.png``, a duel of two arms, which
requires robosuite.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from PIL import Image

import marl_airhockey as ah
from marl_airhockey.evaluation.suites.pieces import suite_names
from marl_airhockey.evaluation.suites.solution import Solution
from marl_airhockey.rollouts.play import play
from marl_airhockey.sim.contracts.palette import LIGHT, rgb
from marl_airhockey.sim.render.picture import draw
from marl_airhockey.sim.render.renderer import Renderer
from marl_airhockey.sim.render.video import write_video
from marl_airhockey.types import Array

COLUMNS, GAP = 2, 12
"""Number of images in a row, and pixels between them."""
MOMENT = 1.9
"""Time of the image of a game, s."""
MEDIUM = 3
"""Class of difficulty of the piece of a suite."""
OBSERVED = ("hit_goal", "duel", "free_for_all")
"""Scenarios whose images are shown."""
IMAGES, SEEN = "pixels:colour=rgb,frames=1", 3
"""Observation type and seed of these images."""
PAUSE, RATE = 20, 20.0
"""Images that hold the end of a video, and images per second."""
VIEWS = "frontview", "agentview", "birdview"
SEEDS = range(2, 22)
"""Seeds that are played until an episode succeeds."""
WIDE = 1.5
"""Ratio of length to width below which tables are rendered smaller."""


def moment(name: str, width: int) -> Array:
    """Return an image of a game, or of the success of a task, by scripted drivers."""
    seats = ah.make_scenario(name).scene.seats
    driver = "allround" if len(seats) > 1 else "striker"
    driver = "reacher" if name.startswith("reach") else driver
    drivers = {f"paddle_{i}": driver for i in range(len(seats))}
    world = ah.make_world(name, drivers=drivers)
    world.autoreset = False
    renderer = Renderer(world, "rgb_array", name.replace("_", " "))
    for seed in SEEDS:
        world.reset(seed)
        renderer.begin()
        for _ in play(world):
            renderer.follow()
            if len(seats) > 1 and world.state.time[0] >= MOMENT:
                break
        if len(seats) > 1 or world.episode.success.any():
            break
    x, y = world.scene.table.size
    return draw(renderer.frame(), width if x > WIDE * y else round(0.75 * width))


def film_of(name: str, width: int) -> list[Array]:
    """Return the images of a piece of a suite, played by its solution."""
    suite = ah.load_suite(name)
    drivers = {"paddle_0": Solution(name), **suite.drivers}
    world = ah.make_world(suite.scenario, drivers=drivers)
    world.autoreset = False
    renderer = Renderer(world, "rgb_array", name)
    world.reset(int((suite.pieces.difficulty == MEDIUM).argmax()))
    renderer.begin()
    images = []
    for _ in play(world):
        renderer.follow()
        images.append(draw(renderer.frame(), width))
    return images


def set_pieces(path: Path, width: int) -> None:
    """Write a video with one piece of each suite, side by side."""
    films = [film_of(name, width) for name in suite_names()]
    longest = max(map(len, films)) + PAUSE
    for film in films:
        film += film[-1:] * (longest - len(film))
    write_video(
        path, [sheet(list(each), width) for each in zip(*films, strict=True)], RATE
    )


def observations(scale: int = 4) -> Array:
    """Return an image of what seats observe as images, enlarged."""
    shown = []
    for name in OBSERVED:
        seats = len(ah.make_scenario(name).scene.seats)
        drivers = {f"paddle_{i}": "allround" for i in range(1, seats)}
        world = ah.make_world(name, drivers=drivers, observe=IMAGES)
        world.reset(SEEN)
        for _ in range(20):
            world.step(np.zeros((1, 1, 2)))
        image = np.asarray(world.observe(np.array([0])))[0, 0]
        shown.append(image.repeat(scale, 0).repeat(scale, 1))
    gap = np.full((len(shown[0]), GAP, 3), 255, np.uint8)
    return np.hstack([part for image in shown for part in (image, gap)][:-1])


def arms(width: int, seconds: float = 1.5) -> Array:
    """Return an image of two arms in a duel, ``width`` is that of the small views."""
    drivers = {"paddle_0": "allround", "paddle_1": "allround"}
    options = {"seats": "robot"}
    world = ah.make_world("duel", drivers=drivers, backend="robosuite", options=options)
    world.autoreset = False
    world.reset(1)
    for _ in play(world):
        if world.state.time[0] >= seconds:
            break
    large, *small = (
        Renderer(world, "rgb_array", "", viewpoint=view).take_picture(size)
        for view, size in zip(VIEWS, (2 * width, width, width), strict=True)
    )
    return np.hstack([large, np.vstack(small)])


def save(path: Path, image: Array) -> None:
    """Write an image (H, W, 3) as a PNG file."""
    Image.fromarray(image).save(path, optimize=True)


def sheet(pictures: list[Array], width: int) -> Array:
    """Return one image with several images in centred rows, the narrow ones last."""
    total, rows = COLUMNS * width + GAP, list[list[Array]]()
    for picture in sorted(pictures, key=lambda picture: -picture.shape[1]):
        filled = sum(p.shape[1] + GAP for p in rows[-1]) if rows else total
        if filled + picture.shape[1] > total:
            rows.append([])
        rows[-1].append(picture)
    high = sum(max(map(len, row)) + GAP for row in rows) - GAP
    image = np.full((high, total, 3), rgb(LIGHT["room"]), np.uint8)
    top = 0
    for row in rows:
        left = (total - sum(p.shape[1] + GAP for p in row) + GAP) // 2
        for picture in row:
            high, wide = picture.shape[:2]
            image[top : top + high, left : left + wide] = picture
            left += wide + GAP
        top += max(map(len, row)) + GAP
    return image


def main(
    out: Annotated[Path, typer.Option(help="Folder of the PNG files.")] = Path(
        "docs/images"
    ),
    width: Annotated[int, typer.Option(help="Width of one image, px.")] = 560,
    arm: Annotated[bool, typer.Option("--arm", help="Only the image of arms.")] = False,
) -> None:
    """Play all scenarios, write one image of each kind, and a video of the suites."""
    out.mkdir(parents=True, exist_ok=True)
    if arm:
        save(out / "arm.png", arms(320))
        return
    kinds: dict[str, list[Array]] = {"tasks": [], "games": []}
    for name in ah.scenario_names():
        alone = len(ah.make_scenario(name).scene.seats) == 1
        kinds["tasks" if alone else "games"].append(moment(name, width))
    for kind, pictures in kinds.items():
        save(out / f"{kind}.png", sheet(pictures, width))
    set_pieces(out / "set_pieces.webp", width)
    save(out / "image_observations.png", observations())


if __name__ == "__main__":
    typer.run(main)
