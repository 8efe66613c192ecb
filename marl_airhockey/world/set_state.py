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

from marl_airhockey.core.errors import unknown_name
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import Bodies, State
from marl_airhockey.types import Memory


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
    if _counts(state.bodies) != _counts(scene.bodies):
        raise ValueError(
            f"state: it is of another scene, with {_counts(state.bodies)}; here there "
            f"are {_counts(scene.bodies)}"
        )
    rest = scene.still_state(count)
    fields: dict[str, Any] = {}
    for name in ("position", "velocity", "angle", "spin", "time"):
        wanted, value = getattr(rest, name), np.asarray(getattr(state, name))
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
        ValueError: a missing or unknown name, or a wrong shape, named.
    """
    for name in memory:
        if name not in like:
            raise ValueError(unknown_name("memory", name, like))
    rows: Memory = {}
    for name, kept in like.items():
        if name not in memory:
            raise ValueError(f"memory: {name!r} is missing")
        value, shape = np.asarray(memory[name]), (count, *kept.shape[1:])
        if value.shape == shape[1:] and count == 1:
            value = value[None]
        if value.shape != shape:
            raise ValueError(
                f"memory {name!r}: expected shape {shape}, got {value.shape}"
            )
        rows[name] = value
    return rows
