"""Columns of a recording: conversion of worlds to columns and back to states."""

from __future__ import annotations

import datetime
import json
import platform
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.registry import DEFAULT_BACKEND, make_scenario
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.physics import load_physics
from marl_airhockey.sim.core.recording import Columns, Episode, Recording
from marl_airhockey.sim.core.state import RESULTS, State
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Memory

STATE, SENSED, MEMORY, TERM = "state.", "sensed.", "memory.", "term."
JUDGED = "judged."
"""Prefixes of the names of columns."""
SHARED = ("seats", "goals")
"""Keywords of environments that are options of all scenarios."""
PATH = "path"
"""Name of the path within a step, which the states of some scenes contain."""
SEEN = ("position", "velocity", "visible")
"""Fields of the sensed state that are stored."""


def head_of(world: World, keywords: Keywords) -> dict[str, Any]:
    """Return the metadata that all episodes of a recording of a world share."""
    return {
        "began": datetime.datetime.now(datetime.UTC).isoformat(),
        "scenario": world.scenario.name,
        "options": dict(keywords.get("options", {})),
        "backend": keywords.get("backend", DEFAULT_BACKEND),
        "profile": keywords.get("profile", "ideal"),
        "physics": _physics(keywords),
        "control_dt": world.control_dt,
        "max_cycles": world.max_cycles,
        "observe": world.observer.observe,
        "observation_labels": list(world.observation_labels),
        **{name: keywords[name] for name in SHARED if name in keywords},  # type: ignore[literal-required]
        **_rig(keywords),
        "versions": {
            "marl_airhockey": metadata.version("marl_airhockey"),
            "python": platform.python_version(),
        },
    }


def _physics(keywords: Keywords) -> Any:
    """Return the physics of keywords, with the content of a file."""
    given = keywords.get("physics")
    return load_physics(given) if isinstance(given, (str, Path)) else given


def _rig(keywords: Keywords) -> dict[str, Any]:
    """Return the content of the rig file of a real table."""
    path = keywords.get("rig")
    return {"rig": json.loads(Path(path).read_text())} if path else {}


class EpisodeNotes(NamedTuple):
    """Seed and physics of an episode."""

    seed: int
    number: int
    """Number of the episode since the seed was set."""
    physics: dict[str, float]


def episode_notes(world: World, row: int = 0) -> EpisodeNotes:
    """Return seed and physics of the running episode of a world."""
    episode = world.episode
    physics = {k: float(v[row]) for k, v in episode.physics.items()}
    return EpisodeNotes(int(world.seeds[row]), int(episode.number[row]), physics)


def first_columns(world: World, names: Collection[str] | None = None) -> Columns:
    """Return the current state, memory and observation as columns (B, ...).

    Args:
        world: Worlds whose episodes have begun.
        names: Names of the requested columns; None for all.
    """
    return _columns(BEFORE, world, names)


def step_columns(world: World, names: Collection[str] | None = None) -> Columns:
    """Return the columns (B, ...) of the last step.

    Args:
        world: Worlds that have made a step.
        names: Names of the requested columns; None for all.
    """
    return _columns(BEFORE, world, names) | _columns(AFTER, world, names)


def of_single_world(columns: Columns) -> Columns:
    """Return the columns (1, ...) of a single world without the batch axis."""
    return {name: value[0] for name, value in columns.items()}


def _columns(
    sources: Mapping[str, Callable[[World], Columns]],
    world: World,
    names: Collection[str] | None,
) -> Columns:
    """Return the requested columns of sources; others are not computed."""
    found: Columns = {}
    for beginnings, source in sources.items():
        if names is None or any(n.startswith(tuple(beginnings.split())) for n in names):
            found |= source(world)
    return found if names is None else {n: v for n, v in found.items() if n in names}


def _states(world: World) -> Columns:
    state = world.state
    columns = {STATE + name: getattr(state, name) for name in RESULTS}
    return columns | ({} if state.path is None else {STATE + PATH: state.path})


def _sensed(world: World) -> Columns:
    columns: Columns = {}
    if not world.sensor.ideal:
        sensed = world.sensed
        columns |= {SENSED + name: getattr(sensed, name) for name in SEEN}
        columns[f"{SENSED}age"] = world.sensor.age
    if world.live is not None:
        columns[f"{SENSED}visible"] = world.state.visible
    return columns


def _memories(world: World) -> Columns:
    return {MEMORY + name: value for name, value in world.memory.items()}


def _observations(world: World) -> Columns:
    if world.observer.observe in world.observer.images:
        return {}
    shown = world.observe(np.arange(len(world.scene.seats)))
    if isinstance(shown, Mapping):
        return {f"observation.{k}": v for k, v in shown.items()}
    return {"observation": shown}


def _terms(world: World) -> Columns:
    return {TERM + name: value for name, value in world.terms.items()}


def _judged(world: World) -> Columns:
    """Return the states that the rules evaluated, in games that serve afterwards."""
    if not world.serves:
        return {}
    judged = world.judged
    return {JUDGED + name: getattr(judged, name) for name in RESULTS}


def _devices(world: World) -> Columns:
    """Return the numbers (1, ...) that the devices of a real table report."""
    if world.live is None:
        return {}
    numbers = world.live.telemetry()
    return {
        f"device.{name}": np.array([np.nan if value is None else value], np.float64)
        for name, value in numbers.items()
        if not isinstance(value, str)
    }


BEFORE: Mapping[str, Callable[[World], Columns]] = {
    STATE: _states,
    SENSED: _sensed,
    MEMORY: _memories,
    "observation": _observations,
    "device.": _devices,
}
"""Sources of the columns that also exist before the first step, by the prefixes of
their names."""
AFTER: Mapping[str, Callable[[World], Columns]] = {
    "action": lambda world: {"action": world.requested},
    "delayed_action": lambda world: {"delayed_action": world.action},
    "command": lambda world: {"command": world.command},
    "reward applied_action terminated truncated violation": lambda world: world.outcome,
    TERM: _terms,
    "returns": lambda world: {"returns": world.episode.returns},
    "success": lambda world: {"success": world.episode.success},
    JUDGED: _judged,
}
"""Sources of the columns that exist only for steps, by the prefixes of their names."""


def scenario_of(recording: Recording) -> Scenario:
    """Return the scenario that was recorded.

    Raises:
        ValueError: It is not installed, or has other bodies.
    """
    head = recording.head
    try:
        shared = {name: head[name] for name in SHARED if name in head}
        scenario = make_scenario(
            head["scenario"], **{**head.get("options", {}), **shared}
        )
    except (ValueError, TypeError) as error:
        raise ValueError(f"{recording.path}: {error}") from error
    bodies = len(scenario.scene.bodies)
    for episode in recording.episodes:
        if STATE + "position" not in episode.first:
            raise ValueError(
                f"{recording.path}: it contains no states, like datasets of others"
            )
        found = episode.first[STATE + "position"]
        if found.shape != (bodies, 2):
            raise ValueError(
                f"{recording.path}: it has {len(found)} bodies and the scenario "
                f"{scenario.name!r} has {bodies}: it was recorded by another version"
            )
    return scenario


def states_of(episode: Episode, scenario: Scenario) -> State:
    """Return the states (T + 1, ...) of an episode, from before the first step on.

    Raises:
        ValueError: A column is missing or has another shape. The message names it.
    """
    rows = len(episode) + 1
    still = scenario.scene.still_state(rows)
    fields = {}
    for name in RESULTS:
        value = _joined(episode, STATE + name)
        wanted = getattr(still, name)
        if value.shape != wanted.shape:
            raise ValueError(
                f"{STATE}{name}: shape {value.shape}, expected {wanted.shape}"
            )
        fields[name] = value
    return replace(still, **fields)


def memories_of(episode: Episode) -> Memory:
    """Return the scenario's memories (T + 1, ...) of an episode."""
    names = [n for n in episode.first if n.startswith(MEMORY)]
    return {n.removeprefix(MEMORY): _joined(episode, n) for n in names}


def _joined(episode: Episode, name: str) -> Any:
    """Return a column with its first value before it.

    Raises:
        ValueError: The column is missing.
    """
    if name not in episode.first:
        raise ValueError(f"{name}: the column is missing")
    first = episode.first[name][None]
    if not len(episode):
        return first
    if name not in episode.columns:
        raise ValueError(f"{name}: the column is missing")
    return np.concatenate([first, episode.columns[name]])
