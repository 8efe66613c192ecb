"""Record: episodes of a driver, played in one batch and written to one file."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.blocks import Columns
from marl_airhockey.core.recording import SUFFIX, RecordingWriter
from marl_airhockey.data.columns import (
    first_columns,
    head_of,
    notes_of,
    step_columns,
)
from marl_airhockey.devices.camera import Film
from marl_airhockey.devices.camera.film import SUFFIX as FILM_SUFFIX
from marl_airhockey.registry import DEFAULT_BACKEND, find_backend
from marl_airhockey.world.build import Keywords, build_driven_world
from marl_airhockey.world.world import World

AT_ONCE = 250
"""Episodes that are played in one batch"""


def record_episodes(
    driver: Driver,
    name: str,
    scenario: str | Scenario,
    episodes: int,
    folder: Path,
    seed: int,
    keywords: Keywords,
    film: bool = False,
) -> Path:
    """Let a driver play at ``paddle_0`` and its team's seats, and record it.

    Args:
        driver: that plays.
        name: its name in the file.
        scenario: name of the scenario, or a scenario object.
        episodes: number of them; episode i has the seed ``seed + i``.
        folder: of the file, made if it does not exist.
        seed: of the first episode.
        keywords: of the environment, drivers of other seats among them.
        film: whether to keep the pictures of a real table's camera beside it.

    Returns:
        The path of the file. It has that name when it is whole; until then, and if this
        is interrupted, it ends in ``.part``.

    Raises:
        ValueError: a seat without a driver, a folder that cannot be made, or a film
            where there is no camera.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{folder}: {error.strerror}") from error
    live = find_backend(keywords.get("backend", DEFAULT_BACKEND)).senses_itself
    at_once = 1 if live else min(episodes, AT_ONCE)
    world = build_driven_world(driver, scenario, at_once, keywords)
    now = datetime.datetime.now(datetime.UTC).strftime("%Y%m%d-%H%M%S-%f")
    path = folder / f"{now}-{world.scenario.name}{SUFFIX}"
    others = keywords.get("drivers", {})
    players = [
        _player(name if i == 0 else others.get(f"paddle_{i}", name))
        for i in range(len(world.scene.seats))
    ]
    head = {**head_of(world, keywords), "players": players}
    reel = _film(world, path) if film else None
    if reel is not None:
        head["film"] = path.with_suffix(FILM_SUFFIX).name
    partial = path.with_suffix(f"{SUFFIX}.part")
    writer = RecordingWriter(partial, head)
    try:
        for first in range(0, episodes, at_once):
            world.reset(seed + first)
            _record(world, writer, min(at_once, episodes - first))
    finally:
        writer.close()
        if reel is not None:
            reel.close()
        world.close()
    return partial.rename(path)


def _film(world: World, path: Path) -> Film:
    """Begin to film a real table.

    Raises:
        ValueError: there is no camera.
    """
    from marl_airhockey.backends.real.backend import RealBackend

    if not isinstance(world.backend, RealBackend):
        raise ValueError("--film: only a real table has a camera; add --backend real")
    return Film(world.backend.camera, path.with_suffix(FILM_SUFFIX))


def _player(driver: Any) -> dict[str, Any]:
    """Return how a seat is described in a head."""
    name = driver if isinstance(driver, str) else type(driver).__name__
    return {"driver": name, "person": None}


def _record(world: World, writer: RecordingWriter, count: int) -> None:
    """Play an episode in each world, and write the first ``count`` of them."""
    first, notes = first_columns(world), [notes_of(world, i) for i in range(count)]
    rows: list[Columns] = []
    length = np.zeros(world.num_worlds, np.int64)
    done, no_actions = length > 0, np.zeros((world.num_worlds, 0, 2))
    reasons = [""] * count
    while not done[:count].all():
        result = world.step(no_actions)
        length[~done] += 1
        done |= result.terminated | result.truncated
        rows.append(step_columns(world))
        if result.interruption:
            reasons[0] = result.interruption
    whole = {name: np.stack([row[name] for row in rows], 1) for name in rows[0]}
    for i in range(count):
        writer.begin(notes[i], {name: value[i] for name, value in first.items()})
        writer.add_rows({n: value[i, : length[i]] for n, value in whole.items()})
        writer.end(
            {"reason": reasons[i] or "played to the end", "steps": int(length[i])}
        )
