"""Columns of a recording: what is kept of worlds, and states made of it again."""

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
"""Beginnings of the names of columns"""
SHARED = ("seats", "goals")
"""Keywords of environments that are options of all scenarios"""
PATH = "path"
"""Field of the states of scenes that need it"""
SEEN = ("position", "velocity", "visible")
"""Fields of the sensed state that are kept"""


def head_of(world: World, keywords: Keywords) -> dict[str, Any]:
    """Return what holds for all episodes of a recording of a world."""
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
    """Return the physics that keywords name, whole: a file may change."""
    given = keywords.get("physics")
    return load_physics(given) if isinstance(given, (str, Path)) else given


def _rig(keywords: Keywords) -> dict[str, Any]:
    """Return the rig of a real table, whole: its file may be another one tomorrow."""
    path = keywords.get("rig")
    return {"rig": json.loads(Path(path).read_text())} if path else {}


class EpisodeNotes(NamedTuple):
    """Seed and physics of an episode."""

    seed: int
    number: int
    """Number of the episode since the world had that seed"""
    physics: dict[str, float]


def episode_notes(world: World, row: int = 0) -> EpisodeNotes:
    """Return what holds for the running episode of a world."""
    episode = world.episode
    physics = {k: float(v[row]) for k, v in episode.physics.items()}
    return EpisodeNotes(int(world.seeds[row]), int(episode.number[row]), physics)


def first_columns(world: World, names: Collection[str] | None = None) -> Columns:
    """Return the columns (B, ...) of what is there now: state, memory, observation.

    Args:
        world: Worlds whose episodes have begun.
        names: Names of the columns that are wanted; None for all.
    """
    return _columns(BEFORE, world, names)


def step_columns(world: World, names: Collection[str] | None = None) -> Columns:
    """Return the columns (B, ...) of the step that was made last.

    Args:
        world: Worlds that have made a step.
        names: Names of the columns that are wanted; None for all.
    """
    return _columns(BEFORE, world, names) | _columns(AFTER, world, names)


def _columns(
    sources: Mapping[str, Callable[[World], Columns]],
    world: World,
    names: Collection[str] | None,
) -> Columns:
    """Return the columns of sources; what is not wanted is not computed either."""
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
    if world.observer.observe == "pixels":
        return {}
    shown = world.observe(np.arange(len(world.scene.seats)))
    if isinstance(shown, Mapping):
        return {f"observation.{k}": v for k, v in shown.items()}
    return {"observation": shown}


def _terms(world: World) -> Columns:
    return {TERM + name: value for name, value in world.terms.items()}


def _judged(world: World) -> Columns:
    """Return the states that the rules judged, in games that serve after it."""
    if not world.serves:
        return {}
    judged = world.judged
    return {JUDGED + name: getattr(judged, name) for name in RESULTS}


def _devices(world: World) -> Columns:
    """Return the numbers that devices of a real table report, (1, ...) each."""
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
}
"""Sources of the columns that exist before the first step, too, by the beginnings of
their names"""
AFTER: Mapping[str, Callable[[World], Columns]] = {
    "action": lambda world: {"action": world.requested},
    "delayed_action": lambda world: {"delayed_action": world.action},
    "command": lambda world: {"command": world.command},
    "reward applied_action terminated truncated violation": lambda world: world.outcome,
    TERM: _terms,
    "returns": lambda world: {"returns": world.episode.returns},
    "success": lambda world: {"success": world.episode.success},
    JUDGED: _judged,
    "device.": _devices,
}
"""Sources of the columns of a step"""


def scenario_of(recording: Recording) -> Scenario:
    """Return the scenario that was recorded.

    Raises:
        ValueError: one that is not installed here, or with other bodies.
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
                f"{recording.path}: there are no states in it, as in datasets of others"
            )
        found = episode.first[STATE + "position"]
        if found.shape != (bodies, 2):
            raise ValueError(
                f"{recording.path}: it has {len(found)} bodies and the scenario "
                f"{scenario.name!r} has {bodies}: it was recorded by another version"
            )
    return scenario


def states_of(episode: Episode, scenario: Scenario) -> State:
    """Return the states (T + 1, ...) of an episode, that before the first step first.

    Raises:
        ValueError: a column that is missing or of another shape, named.
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
        ValueError: it is missing.
    """
    if name not in episode.first:
        raise ValueError(f"{name}: it is missing")
    first = episode.first[name][None]
    if not len(episode):
        return first
    if name not in episode.columns:
        raise ValueError(f"{name}: it is missing")
    return np.concatenate([first, episode.columns[name]])
