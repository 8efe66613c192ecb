"""Watch a driver: in a window, or as a video file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from marl_airhockey.driver import Driver
from marl_airhockey.make import Keywords
from marl_airhockey.match import seat_world
from marl_airhockey.render import TOP, Renderer
from marl_airhockey.scenario import Scenario
from marl_airhockey.state import Array

FINAL_HOLD = 0.7
"""s: how long a video rests on the last picture of an episode."""


def film(
    scenario: str | Scenario,
    driver: Driver,
    keywords: Keywords,
    seed: int = 0,
    episodes: int = 1,
    video: Path | None = None,
    width: int = 640,
    seconds: float = float("inf"),
    camera: str = TOP,
) -> list[Array]:
    """Play some episodes with ``driver`` at paddle_0 and show them.

    Args:
        scenario: its name, or a scenario object.
        driver: who plays.
        keywords: of the environment.
        seed: of the first episode.
        episodes: how many.
        video: a .gif or .mp4 to write; None opens a window.
        width: of the pictures, pixels.
        seconds: at most this much of each episode.
        camera: the view: "top", or one of the backend's cameras.

    Returns:
        The pictures (H, W, 3) uint8; none if they went to a window.

    Raises:
        RuntimeError: there is no screen for a window.
    """
    if video is None and not any(
        os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    ):
        raise RuntimeError("there is no screen here: use --video FILE.gif or FILE.mp4")
    if video is not None and video.suffix not in (".gif", ".mp4"):
        raise ValueError(f"video: {video.name!r} must end in .gif or .mp4")
    world = seat_world(driver, scenario, 1, keywords)
    mode = "human" if video is None else "rgb_array"
    title = world.scenario.name.replace("_", " ")
    renderer = Renderer(world, mode, title, camera=camera)
    fps = 1 / world.control_dt
    pictures: list[Array] = []
    for episode in range(episodes):
        world.reset(seed if episode == 0 else None)
        renderer.begin()
        over = False
        while not over and float(world.state.time[0]) < seconds:
            step = world.step(np.zeros((1, 0, 2)))
            over = bool(step.terminated[0] or step.truncated[0])
            renderer.follow()
            if video is not None:
                pictures.append(renderer.picture(width))
        pictures += pictures[-1:] * round(FINAL_HOLD * fps)
    if video is not None:
        write_video(video, pictures, fps)
    renderer.close()
    world.close()
    return pictures


def write_video(path: Path | str, pictures: Sequence[Array], fps: float) -> Path:
    """Write pictures (H, W, 3) as a .gif or an .mp4.

    Raises:
        ValueError: no picture, or another ending.
        OSError: the file could not be written.
    """
    path = Path(path)
    if not pictures:
        raise ValueError("video: no pictures to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".gif":
        # One palette and no dithering: frames then differ only where things move.
        some = [pictures[0], pictures[len(pictures) // 2], pictures[-1]]
        palette = Image.fromarray(np.concatenate(some)).quantize(128)
        frames = [
            Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE)
            for p in pictures
        ]
        rest, lasts = frames[1:], round(1000 / fps)
        frames[0].save(path, append_images=rest, save_all=True, duration=lasts, loop=0)
    elif path.suffix == ".mp4":
        size = (pictures[0].shape[1], pictures[0].shape[0])
        code = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(path), code, fps, size)
        if not writer.isOpened():
            raise OSError(f"video: {path} could not be written")
        for picture in pictures:
            writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        writer.release()
    else:
        raise ValueError(f"video: {path.name!r} must end in .gif or .mp4")
    return path
