"""Display of episodes in a window or as a video."""

from __future__ import annotations

import os
from pathlib import Path

from marl_airhockey.build import build_driven_world
from marl_airhockey.rollouts.play import play
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.render.renderer import TOP, Renderer
from marl_airhockey.sim.render.video import check_ending, width_of, write_video
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

FINAL_HOLD = 0.7
"""Time for which a video shows the last image of an episode, s."""
RATE = 30.0
"""Largest number of images per second in the video of a recording."""


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
        scenario: Name, code, class or object, see `registry.find_scenario`.
        driver: Driver of ``paddle_0``.
        keywords: Keywords of the environment.
        seed: Seed of the first episode.
        episodes: Number of episodes.
        video: Path of the .gif, .webp or .mp4 file to write; None opens a window.
        width: Width of the video, pixels; None for the default of the file type.
        seconds: Time after which an episode is stopped, s.
        viewpoint: Camera of images, "top" or a viewpoint of the backend.

    Returns:
        The images (H, W, 3) uint8 of the video; an empty list for a window.

    Raises:
        RuntimeError: There is no display for a window.
        ValueError: The video has another file type.
    """
    if video is None and not any(
        os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    ):
        raise RuntimeError("there is no display; use --video FILE.gif or FILE.mp4")
    if video is not None:
        check_ending(video)
    width = width or width_of(video or "")
    world = build_driven_world(driver, scenario, 1, keywords)
    mode = "human" if video is None else "rgb_array"
    renderer = Renderer(world, mode, _title(world), viewpoint=viewpoint)
    fps = 1 / world.control_dt
    images: list[Array] = []
    for episode in range(episodes):
        world.reset(seed if episode == 0 else None)
        renderer.begin()
        for _ in play(world):
            renderer.follow()
            if video is not None:
                images.append(renderer.take_picture(width))
            if world.state.time[0] >= seconds:
                break
        images += images[-1:] * round(FINAL_HOLD * fps)
    if video is not None:
        write_video(video, images, fps)
    renderer.close()
    world.close()
    return images


def write_replay(replay: Replay, video: Path, width: int | None = None) -> None:
    """Write a video of a recorded episode.

    Args:
        replay: Replay of one episode.
        video: Path of the .gif, .webp or .mp4 file to write.
        width: Width of the video, pixels; None for the default of the file type.

    Raises:
        ValueError: The video has another file type.
    """
    check_ending(video)
    world, width = replay.world, width or width_of(video)
    renderer = Renderer(world, "rgb_array", _title(world))
    every, images = max(round(1.0 / (RATE * world.control_dt)), 1), list[Array]()
    replay.begin()
    for t in range(int(replay.lengths[0])):
        replay.step(t)
        renderer.follow()
        if (t + 1) % every == 0:
            images.append(renderer.take_picture(width))
    write_video(video, images, 1 / (every * world.control_dt))


def _title(world: World) -> str:
    return world.scenario.name.replace("_", " ")
