"""Draw every scenario a moment into a scripted episode, as one picture for the docs.

python scripts/picture_tasks.py --out docs/images/tasks.png
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

import marl_airhockey as ah
from marl_airhockey.render import Renderer, draw

COLUMNS = 2
MOMENT = 1.9
"""s into the episode, or its last moment."""


def main(
    out: Annotated[Path, typer.Option(help="PNG to write.")] = Path(
        "docs/images/tasks.png"
    ),
    width: Annotated[int, typer.Option(help="Pixels of one scene.")] = 560,
) -> None:
    """Play, draw, paste."""
    pictures = []
    for name in ah.scenario_names():
        driver = "reacher" if name.startswith("reach") else "striker"
        world = ah.make_world(name, drivers={"paddle_0": driver})
        world.autoreset = False
        world.reset(2)
        renderer = Renderer(world, "rgb_array", name.replace("_", " "))
        over = False
        while not over and world.state.time[0] < MOMENT:
            step = world.step(np.zeros((1, 0, 2)))
            over = bool(step.terminated[0] or step.truncated[0])
            renderer.follow()
        pictures.append(draw(renderer.scene(), width))
    rows = [
        np.concatenate(pictures[i : i + COLUMNS], axis=1)
        for i in range(0, len(pictures), COLUMNS)
    ]
    out.parent.mkdir(parents=True, exist_ok=True)
    picture = np.concatenate(rows, axis=0)
    cv2.imwrite(str(out), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    typer.run(main)
