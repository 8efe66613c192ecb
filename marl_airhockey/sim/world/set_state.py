"""States and memories that are set from outside: checked, and without past events.

`World.set_state` continues as if every body had moved there at its velocity and bodies
that touch had touched before: lasting contacts and crossings are not new ones, the
sensor's past is that of constant velocities, no delayed action is under way, and the
memory of drivers is new. The clock is that of ``state.time``; returns and success are
reset. Episode number, seed, physics and random streams continue.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import Bodies, State
from marl_airhockey.types import Array, Memory


def checked_worlds(worlds: object, count: int) -> Array:
    """Return indices (W,) of some of ``count`` worlds; None for all.

    Raises:
        ValueError: Not whole numbers, none at all, one twice, or one that is no world.
    """
    if worlds is None:
        return np.arange(count)
    found = np.asarray(worlds)
    if found.ndim != 1 or found.dtype.kind not in "iu" or not len(found):
        raise ValueError(f"worlds: expected indices of worlds, got {worlds!r}")
    odd = found[(found < 0) | (found >= count)]
    if len(odd):
        raise ValueError(f"worlds: there is no world {odd[0]}, only {count} from 0 on")
    if len(np.unique(found)) < len(found):
        raise ValueError(f"worlds: {worlds!r} names one twice")
    return found


def settled(state: State, scene: Scene, count: int) -> State:
    """Return a given state as rows in which nothing is happening.

    Overlapping paddles and pucks touch; there is no other event.

    Args:
        state: (W, ...), or of one world without the leading axis.
        scene: what must be on the table.
        count: W.

    Raises:
        ValueError: another scene, or a field of a wrong shape or not finite, named.
    """
    if not isinstance(state, State):
        raise ValueError(f"state: expected a State, got {type(state).__name__}")
    if _counts(state.bodies) != _counts(scene.bodies):
        raise ValueError(
            f"state: it is of another scene, with {_counts(state.bodies)}; here there "
            f"are {_counts(scene.bodies)}"
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
        raise ValueError("state.position: obstacles must be where the scene has them")
    made = replace(rest, **fields)
    gap = made.paddle[..., :, None, :] - made.puck[..., None, :, :]
    touch = scene.table.paddle_radius + scene.table.puck_radius
    near = np.hypot(gap[..., 0], gap[..., 1]) < touch
    return replace(made, touching=near)


def _numbers(name: str, given: object) -> Array:
    """Return an array of real numbers.

    Raises:
        ValueError: Something else, named.
    """
    try:
        found = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if found.dtype.kind not in "biuf":
        raise ValueError(f"{name}: expected numbers, got {found.dtype}")
    return found


def _counts(bodies: Bodies) -> str:
    """Return how many bodies of each kind there are, in words."""
    kinds = ("paddles", "pucks", "blocks", "obstacles")
    return ", ".join(f"{getattr(bodies, kind)} {kind}" for kind in kinds)


def checked_memory(memory: Memory, like: Memory, count: int) -> Memory:
    """Return a given memory with ``count`` rows.

    Args:
        memory: (W, ...), or of one world without the leading axis.
        like: memory that the worlds have.
        count: W.

    Raises:
        ValueError: a missing or unknown name, a wrong shape, or what is no number,
            named.
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
