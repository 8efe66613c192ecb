"""Videos of recordings."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.core.state import State
from marl_airhockey.evaluation.recordings import read
from marl_airhockey.registry import make_scenario
from marl_airhockey.render.picture import Frame, draw
from marl_airhockey.render.renderer import Renderer
from marl_airhockey.render.video import write_video

EVERY = 2
"""Control steps from one picture to the next; 2 give 30 pictures a second."""


def write_recording_video(recording: Path, video: Path, width: int = 640) -> None:
    """Write a video of a recording, drawn as `airhockey watch` draws a game.

    Args:
        recording: its file.
        video: the file to write, .gif or .mp4.
        width: of the pictures, pixels.

    Raises:
        ValueError: no recording, or a video that ends in neither .gif nor .mp4.
    """
    meta, steps, _ = read(recording)
    if not steps:
        raise ValueError(f"{recording}: there are no steps in it")
    name = meta["match"]["scenario"]
    scenario = make_scenario(name, **meta["options"])
    scene = scenario.scene
    blank = scene.still_state(1).map(lambda x: x[0])
    trails: list[deque[tuple[float, float]]] = [
        deque(maxlen=Renderer.TRAIL) for _ in range(scene.pucks)
    ]
    pictures = []
    for row in steps:
        for trail, puck in zip(trails, row["pucks"], strict=True):
            trail.append((puck[0], puck[1]))
        if row["n"] % EVERY:
            continue
        frame = Frame(
            scene=scene,
            state=_state(blank, row),
            marks=[_mark(mark) for mark in row["marks"]],
            trails=[list(trail) for trail in trails],
            title=name.replace("_", " "),
            note=f"{row['caption']}   {row['time']:4.1f} s",
            clock=row["time"] / meta["match"]["seconds"],
            success=bool(row["success"]),
            retired=[i in row["retired"] for i in range(len(scene.seats))],
        )
        pictures.append(draw(frame, width))
    write_video(video, pictures, 1 / (EVERY * meta["control_dt"]))


def _state(blank: State, row: dict[str, Any]) -> State:
    """Return a state with the positions and angles of a recorded step."""
    bodies = blank.bodies
    position, angle = blank.position.copy(), blank.angle.copy()
    position[bodies.paddle] = row["paddles"]
    if row["pucks"]:
        position[bodies.puck] = np.array(row["pucks"])[:, :2]
        # Recordings of before the laws of a real table have no spin.
        angle[bodies.puck] = row.get("puck_angles", 0.0)
    if row["blocks"]:
        position[bodies.block], angle[bodies.block] = row["blocks"], row["angles"]
    return replace(blank, position=position, angle=angle)


def _mark(row: list[Any]) -> Mark:
    kind, ax, ay, bx, by, radius = row
    return Mark(kind, (ax, ay), (bx, by), radius)
