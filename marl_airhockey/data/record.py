"""Recording of episodes of a driver, which are played in batches."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from marl_airhockey.build import build_driven_world
from marl_airhockey.data.derived import resume
from marl_airhockey.data.files import is_recording
from marl_airhockey.data.film import film_columns
from marl_airhockey.data.writer import RecordingWriter, whole_recording
from marl_airhockey.hardware.camera import Film
from marl_airhockey.registry import DEFAULT_BACKEND, is_live
from marl_airhockey.rollouts.columns import (
    episode_notes,
    first_columns,
    head_of,
    of_single_world,
    step_columns,
)
from marl_airhockey.rollouts.play import play
from marl_airhockey.rollouts.rollout import AT_ONCE, play_episodes
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.recording import FILM, PLAYED, Columns
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World


def record_episodes(
    driver: Driver,
    name: str,
    scenario: str | Scenario,
    episodes: int,
    path: Path,
    seed: int,
    keywords: Keywords,
    film: bool = False,
    progress: Callable[[float], None] = lambda done: None,
) -> Path:
    """Record episodes of a driver at ``paddle_0`` and the other seats of its team.

    An interrupted recording is resumed.

    Args:
        driver: Driver that plays.
        name: Name of the driver in the recording.
        scenario: Name of the scenario, or a scenario object.
        episodes: Number of episodes; episode i has the seed ``seed + i``.
        path: Folder of the recording.
        seed: Seed of the first episode.
        keywords: Keywords of the environment, with the drivers of other seats.
        film: True to record the video of a real table's camera.
        progress: Function that is called with the number of completed episodes.

    Returns:
        ``path``.

    Raises:
        ValueError: A seat has no driver; the folder cannot be created, or contains
            another recording or other files; or there is no camera for a video.
        OSError: The disk is full.
    """
    live = is_live(keywords.get("backend", DEFAULT_BACKEND))
    at_once = 1 if live else min(episodes, AT_ONCE)
    world = build_driven_world(driver, scenario, at_once, keywords)
    head = _head(world, name, seed, keywords)
    try:
        camera = _camera(world) if film else None
        with _opened(path, head) as writer:
            begun = writer.episodes
            if begun > episodes:
                raise ValueError(
                    f"{path}: it already has {begun} episodes; give a larger number or "
                    "another folder"
                )
            progress(min(begun, episodes))
            if begun and film:
                raise ValueError(
                    f"{path}: a recording with a video cannot be resumed; give another "
                    "folder"
                )
            reel = Film(camera, path / FILM) if camera is not None else None
            try:
                if live:
                    for number in range(begun, episodes):
                        world.reset(seed + number)
                        _record_live(world, writer, reel)
                        progress(number + 1)
                else:
                    played = play_episodes(world, episodes - begun, seed + begun)
                    for done, episode in enumerate(played, begun + 1):
                        writer.write(episode)
                        progress(done)
            finally:
                if reel is not None:
                    reel.close()
    finally:
        world.close()
    return path


def record_steps(
    driver: Driver,
    name: str,
    scenario: str,
    steps: int,
    path: Path,
    seed: int,
    keywords: Keywords,
) -> Path:
    """Record complete episodes until they have a number of steps in total.

    Args:
        driver: Driver that plays, in simulation.
        name: Name of the driver in the recording.
        scenario: Name of the scenario.
        steps: Least number of steps.
        path: Folder of the recording, which must not exist.
        seed: Seed of the first episode.
        keywords: Keywords of the environment, with the drivers of other seats.

    Returns:
        ``path``.

    Raises:
        ValueError: A seat has no driver, or the folder exists.
    """
    world = build_driven_world(driver, scenario, AT_ONCE, keywords)
    left = steps
    try:
        with whole_recording(path, _head(world, name, seed, keywords)) as writer:
            for episode in play_episodes(world, steps, seed):
                writer.write(episode)
                left -= len(episode)
                if left <= 0:
                    break
    finally:
        world.close()
    return path


def _head(world: World, name: str, seed: int, keywords: Keywords) -> dict[str, Any]:
    """Return the metadata of a recording."""
    others = keywords.get("drivers", {})
    players = [
        _player(name if i == 0 else others.get(f"paddle_{i}", name))
        for i in range(len(world.scene.seats))
    ]
    return {**head_of(world, keywords), "players": players, "first_seed": seed}


def _opened(path: Path, head: dict[str, Any]) -> RecordingWriter:
    """Start a recording, or resume one.

    Raises:
        ValueError: The folder cannot be created, or contains other files.
    """
    if is_recording(path):
        return resume(path, head)
    try:
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()
        return RecordingWriter(path, head)
    except FileExistsError as error:
        raise ValueError(
            f"{path}: this folder contains other files; give another folder"
        ) from error
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error


def _camera(world: World) -> Any:
    """Return the camera of a real table.

    Raises:
        ValueError: There is no camera.
    """
    from marl_airhockey.hardware.table.backend import RealBackend

    if not isinstance(world.backend, RealBackend):
        raise ValueError(
            "--record-video: only a real table has a camera; add --backend real"
        )
    return world.backend.camera


def _player(driver: Any) -> dict[str, Any]:
    """Return the description of a seat in the metadata."""
    name = driver if isinstance(driver, str) else type(driver).__name__
    return {"driver": name, "person": None}


def _record_live(world: World, writer: RecordingWriter, film: Film | None) -> None:
    """Play an episode on a real table; every step is on the disk within a second.

    Args:
        world: World whose episode has started.
        writer: Writer of the recording.
        film: Video of the camera; None to record no video.
    """

    def only(columns: Columns) -> Columns:
        return of_single_world(columns | (film_columns(film) if film else {}))

    writer.begin(only(first_columns(world)), *episode_notes(world))
    reason = PLAYED
    for step in play(world):
        writer.add(only(step_columns(world)))
        reason = step.result.interruption or reason
    writer.end(reason)
