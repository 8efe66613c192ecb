"""Episodes of a driver, shown in a window or written as a video."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.render.renderer import TOP, Renderer
from marl_airhockey.render.video import check_ending, width_of, write_video
from marl_airhockey.types import Array
from marl_airhockey.world.build import Keywords, build_driven_world

FINAL_HOLD = 0.7
"""Time, s, for which a video rests on the last picture of an episode"""


def show_episodes(
    scenario: str | Scenario,
    driver: Driver,
    keywords: Keywords,
    seed: int = 0,
    episodes: int = 1,
    video: Path | None = None,
    width: int | None = None,
    seconds: float = float("inf"),
    viewpoint: str = TOP,
) -> list[Array]:
    """Play some episodes with ``driver`` at ``paddle_0`` and show them.

    Args:
        scenario: name of the scenario, or a scenario object.
        driver: driver that plays.
        keywords: keywords of the environment.
        seed: seed of the first episode.
        episodes: number of episodes.
        video: .gif, .webp or .mp4 to write; None opens a window.
        width: Width of the video, px; None for that of its kind of file.
        seconds: time after which an episode is cut, s.
        viewpoint: "top", or one of the backend's viewpoints.

    Returns:
        The pictures (H, W, 3) uint8 of the video; an empty list for a window.

    Raises:
        RuntimeError: there is no screen for a window.
        ValueError: A video with another ending.
    """
    if video is None and not any(
        os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    ):
        raise RuntimeError("there is no screen here: use --video FILE.gif or FILE.mp4")
    if video is not None:
        check_ending(video)
    width = width or width_of(video or "")
    world = build_driven_world(driver, scenario, 1, keywords)
    mode = "human" if video is None else "rgb_array"
    title = world.scenario.name.replace("_", " ")
    renderer = Renderer(world, mode, title, viewpoint=viewpoint)
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
                pictures.append(renderer.take_picture(width))
        pictures += pictures[-1:] * round(FINAL_HOLD * fps)
    if video is not None:
        write_video(video, pictures, fps)
    renderer.close()
    world.close()
    return pictures
