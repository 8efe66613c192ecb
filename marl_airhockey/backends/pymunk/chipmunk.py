"""Chipmunk's own step driven from compiled code: most substeps need no Python.

A paddle's velocity is set and the space is stepped, substep by substep, until something
touches; from there Python goes on. A vector of two doubles passed by value takes the
place of two double arguments on Unix (x86-64 and ARM64); elsewhere, or if a check at
import fails, `AVAILABLE` is False.
"""

from __future__ import annotations

import os
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pymunk
import pymunk.batch
from numba import njit, types
from pymunk._chipmunk_cffi import ffi, lib

from marl_airhockey.backends._planar.paddles import drive
from marl_airhockey.types import Array

READS = 6
"""Addresses of a space before those of its paddles."""
EVENT, SUBSTEP = 0, 1
"""Columns of the flags: whether anything touches, and the substep that is running."""


def address(thing: Any) -> int:
    """The address of a Chipmunk object."""
    return int(ffi.cast("uintptr_t", thing))


def _function(name: str, *arguments: Any) -> Any:
    # By a name of its own, which compiled code that is kept can find again.
    own = f"marl_airhockey_{name}"
    llvm.add_symbol(own, address(ffi.addressof(lib, name)))
    return types.ExternalFunction(own, types.void(types.intp, *arguments))


_p, _number = types.intp, types.float64
_set_velocity = _function("cpBodySetVelocity", _number, _number)
_set_position = _function("cpBodySetPosition", _number, _number)
_advance = _function("cpSpaceStep", _number)
_each = _function("cpSpaceEachBody", _p, _p)
_copy: Any = types.ExternalFunction("memcpy", types.void(_p, _p, _p))
_zero = np.zeros(1, np.int64)


@njit(cache=True)
def drift(
    worlds: Array,
    goal: Array,
    prescribed: Array,
    lifted: Array,
    kicks: Array,
    dt: float,
    substeps: int,
    diameter: float,
    flags: Array,
    position: Array,
    velocity: Array,
    path: Array,
) -> int:
    """Step quiet worlds until the end or the first event.

    Args:
        worlds: (B, 6 + paddles) addresses: the space, its `Reader`'s five, the
            paddles' bodies.
        goal: (B, paddles, 2) velocity at the end, m/s; the ramp to it is linear.
        told: (B, paddles) moves at its goal all along and does not yield.
        lifted: (B, paddles) touches nothing.
        kicks: (B, N) what a body's vx is ahead of what Chipmunk says, m/s.
        dt: of a substep, s.
        substeps: physics steps in the control step.
        diameter: of a paddle, m.
        flags: (B, 2) EVENT, set by callbacks, and SUBSTEP. A world whose EVENT is set
            before is left alone, with SUBSTEP -1.
        position: (B, N, 2) m, of the movers changed in place.
        velocity: (B, N, 2) m/s, of the movers changed in place.
        path: (B, substeps + 1, movers, 4) filled with x, y, vx, vy at every substep
            (without kicks), or (B, 0, movers, 4).

    Returns:
        The number of worlds that Python must go on with; of these, the paddles are
        where and as fast as they have become, the rest is as it was.
    """
    every, left, paddles = path.shape[1] > 0, 0, goal.shape[1]
    rows, mean = np.empty(path.shape[2:]), np.empty((paddles, 2))
    for b in range(len(worlds)):
        flags[b, SUBSTEP] = -1
        if not flags[b, EVENT]:
            hands, speeds = position[b, :paddles], velocity[b, :paddles]
            if every:
                _record(worlds[b], path[b, 0])
            for k in range(substeps):
                flags[b, SUBSTEP] = k
                rest = substeps - k
                met = drive(
                    hands,
                    speeds,
                    goal[b],
                    prescribed[b],
                    lifted[b],
                    rest,
                    dt,
                    diameter,
                    mean,
                )
                for i in range(paddles):
                    body, vx, vy = worlds[b, READS + i], mean[i, 0], mean[i, 1]
                    _set_velocity(body, vx, vy)
                    if met:
                        x, y = hands[i, 0] - vx * dt, hands[i, 1] - vy * dt
                        _set_position(body, x, y)
                _advance(worlds[b, 0], dt)
                if flags[b, EVENT]:
                    break
                if every:
                    _record(worlds[b], path[b, k + 1])
        if flags[b, EVENT]:
            left += 1
            continue
        _record(worlds[b], rows)
        for i in range(len(rows)):
            position[b, i, 0], position[b, i, 1] = rows[i, 0], rows[i, 1]
            if i >= paddles:
                velocity[b, i, 0] = rows[i, 2] + kicks[b, i]
                velocity[b, i, 1] = rows[i, 3]
    return left


@njit(cache=True)
def step_quiet(
    old_position: Array,
    old_velocity: Array,
    old_time: Array,
    worlds: Array,
    goal: Array,
    prescribed: Array,
    lifted: Array,
    kicks: Array,
    control_dt: float,
    substeps: int,
    diameter: float,
    flags: Array,
    path: Array,
    position: Array,
    velocity: Array,
    time: Array,
    touched: Array,
    touched_at: Array,
    touching: Array,
    crossed: Array,
    crossed_velocity: Array,
    left: Array,
) -> None:
    """A control step by `drift` into arrays of its results, as if nothing happened.

    ``left`` (1,) is the number of worlds that Python must go on with; the others are as
    those of `drift` and of a `State`.
    """
    for b in range(len(worlds)):
        time[b] = old_time[b] + control_dt
        for i in range(position.shape[1]):
            for axis in range(2):
                position[b, i, axis] = old_position[b, i, axis]
                velocity[b, i, axis] = old_velocity[b, i, axis]
        for k in range(touched.shape[2]):
            for i in range(touched.shape[1]):
                touched[b, i, k], touched_at[b, i, k] = 0, np.nan
                touching[b, i, k] = False
            for m in range(crossed.shape[2]):
                crossed[b, k, m] = False
                crossed_velocity[b, k, m, 0] = crossed_velocity[b, k, m, 1] = 0.0
    left[0] = drift(
        worlds,
        goal,
        prescribed,
        lifted,
        kicks,
        control_dt / substeps,
        substeps,
        diameter,
        flags,
        position,
        velocity,
        path,
    )


@njit(cache=True)
def _record(world: Array, rows: Array) -> None:
    _copy(world[2], world[5], 4)
    _each(world[0], world[4], world[1])
    _copy(rows.ctypes.data, world[3], rows.size * 8)


class Reader:
    """Reads all bodies of a space into one kept buffer, in the order they were added.

    pymunk's public call builds a struct at every read.
    """

    def __init__(self, space: pymunk.Space, bodies: int) -> None:
        fields = pymunk.batch.BodyFields
        wanted = fields.POSITION | fields.VELOCITY
        self._buffer = pymunk.batch.Buffer()
        pymunk.batch.get_space_bodies(space, wanted, self._buffer)
        self._data = ffi.new("pmBatchedData *")
        self._data.fields = wanted.value
        self._data.floatArray = self._buffer._float_arr
        self._data.intArray = self._buffer._int_arr
        self._each = ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")
        flat = np.frombuffer(self._buffer.float_buf(), dtype=np.float64)
        self._rows = flat.reshape(-1, 4)[:bodies]
        self._space = space._space
        array = self._buffer._float_arr
        self.addresses = (
            address(self._data),
            address(ffi.addressof(array[0], "num")),
            address(array.arr),
            address(self._each),
            _zero.ctypes.data,
        )
        """Of the struct, of its count of numbers, of the numbers, of what fills it for
        a body, and of a zero."""

    def __call__(self) -> Array:
        """(bodies, 4) x, y, vx, vy; the same memory at every call."""
        self._buffer._float_arr.num = 0
        lib.cpSpaceEachBody(self._space, self._each, self._data)
        return self._rows


@njit(cache=True)
def _try(body: int, vx: float, vy: float) -> None:
    _set_velocity(body, vx, vy)


def _works() -> bool:
    if os.name != "posix":
        return False
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    _try(address(body._body), 0.25, -0.75)
    return tuple(body.velocity) == (0.25, -0.75)


AVAILABLE = _works()


def new_flags(worlds: int) -> Array:
    """(B, 2) flags for `drift`."""
    return np.zeros((worlds, 2), np.int64)
