"""Checks of given states and memories for `World.set_state`.

`World.set_state` continues as if every body had arrived with its velocity, and as if
bodies in contact had been in contact before:

- Contacts and crossings in the state are not new events.
- The history of the sensor follows from constant velocities.
- There are no delayed actions, and the memory of drivers is new.
- The clock is ``state.time``. Returns and success are reset.
- Episode number, seed, physics and random streams continue.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.geometry import length
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import Bodies, State
from marl_airhockey.types import Array, Memory


def checked_worlds(worlds: object, count: int) -> Array:
    """Return the checked indices of worlds (W,); None selects all ``count`` worlds.

    Raises:
        ValueError: An index is not a whole number, does not exist or occurs twice, or
            there is no index.
    """
    if worlds is None:
        return np.arange(count)
    found = np.asarray(worlds)
    if found.ndim != 1 or found.dtype.kind not in "iu" or not len(found):
        raise ValueError(f"worlds: expected indices of worlds, got {worlds!r}")
    odd = found[(found < 0) | (found >= count)]
    if len(odd):
        raise ValueError(
            f"worlds: there is no world {odd[0]}; the batch has {count}, counted from 0"
        )
    if len(np.unique(found)) < len(found):
        raise ValueError(f"worlds: {worlds!r} contains an index twice")
    return found


def settled(state: State, scene: Scene, count: int) -> State:
    """Return a given state with W rows and without events.

    Overlapping paddles and pucks are in contact.

    Args:
        state: State (W, ...); for one world, the leading axis may be missing.
        scene: Scene of the worlds.
        count: Number of worlds, W.

    Raises:
        ValueError: The state belongs to another scene, or a field has a wrong shape or
            is not finite.
    """
    if not isinstance(state, State):
        raise ValueError(f"state: expected a State, got {type(state).__name__}")
    if _counts(state.bodies) != _counts(scene.bodies):
        raise ValueError(
            f"state: it is of another scene, with {_counts(state.bodies)}; expected "
            f"{_counts(scene.bodies)}"
        )
    rest = scene.still_state(count)
    fields: dict[str, Any] = {}
    for name in ("position", "velocity", "angle", "spin", "time"):
        wanted, value = (
            getattr(rest, name),
            _numbers(f"state.{name}", getattr(state, name)),
        )
        if value.ndim == wanted.ndim - 1 and count == 1:
            value = value[None]
        if value.shape != wanted.shape:
            raise ValueError(
                f"state.{name}: expected shape {wanted.shape}, got {value.shape}"
            )
        if not np.isfinite(value).all():
            raise ValueError(f"state.{name}: every element must be finite")
        fields[name] = value.astype(wanted.dtype)
    obstacles = scene.bodies.movers
    if not np.array_equal(
        fields["position"][:, obstacles:], rest.position[:, obstacles:]
    ):
        raise ValueError(
            "state.position: obstacles must be at their positions in the scene"
        )
    made = replace(rest, **fields)
    gap = made.paddle[..., :, None, :] - made.puck[..., None, :, :]
    touch = scene.table.paddle_radius + scene.table.puck_radius
    near = length(gap) < touch
    return replace(made, touching=near)


def _numbers(name: str, given: object) -> Array:
    """Return an array of real numbers.

    Raises:
        ValueError: The elements are not real numbers.
    """
    try:
        found = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if found.dtype.kind not in "biuf":
        raise ValueError(f"{name}: expected numbers, got {found.dtype}")
    return found


def _counts(bodies: Bodies) -> str:
    """Return the number of bodies of each kind as a text."""
    kinds = ("paddles", "pucks", "blocks", "obstacles")
    return ", ".join(f"{getattr(bodies, kind)} {kind}" for kind in kinds)


def checked_memory(memory: Memory, like: Memory, count: int) -> Memory:
    """Return a given memory with W rows.

    Args:
        memory: Memory (W, ...); for one world, the leading axis may be missing.
        like: Memory of the worlds.
        count: Number of worlds, W.

    Raises:
        ValueError: A name is missing or unknown, a shape is wrong, or an element is not
            a number.
    """
    for name in memory:
        if name not in like:
            raise ValueError(unknown_name("memory", name, like))
    rows: Memory = {}
    for name, kept in like.items():
        if name not in memory:
            raise ValueError(f"memory: {name!r} is missing")
        value = _numbers(f"memory {name!r}", memory[name])
        shape = (count, *kept.shape[1:])
        if value.shape == shape[1:] and count == 1:
            value = value[None]
        if value.shape != shape:
            raise ValueError(
                f"memory {name!r}: expected shape {shape}, got {value.shape}"
            )
        if np.isnan(value).any():
            raise ValueError(f"memory {name!r}: no element may be nan")
        rows[name] = value
    return rows
