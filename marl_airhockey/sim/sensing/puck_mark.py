"""Marks on pucks: orientations and spins that a camera measures.

A mark is a bar through the centre of the puck. It does not shift the centre of the
puck's colour, and it looks the same after half a turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.rng import StreamSet, normal_pair
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.sensing.delay import append, around
from marl_airhockey.types import Array

PERIOD = np.pi
"""Rotation after which a mark looks the same, rad."""
FRAME = 1 / 60
"""Time between two frames of the simulated camera, s. The spin is the difference of the
orientations in them, so spins up to `PERIOD` / (2 `FRAME`) = 94 rad/s are not
ambiguous."""
STREAM = "mark"
"""Purpose of their random streams."""


SPUN = 0.5
"""Standard deviation of the initial speed of a puck's edge, m/s."""
BOUNCE_SPIN, HIT_SPIN = 0.15, 0.3
"""Noise of the speed of the edge after a wall bounce and a hit, as a share of the
closing speed: an unknown friction and, after hits, `spin_scatter`."""


class MarkReadings(NamedTuple):
    """Readings of the marks of pucks in W worlds."""

    angle: Array
    """Orientations in the frame (W, pucks), rad, modulo `PERIOD`."""
    spin: Array
    """Angular velocities, from this frame and the one before (W, pucks), rad/s."""
    read: Array
    """(W, pucks) bool: the mark was read in both frames."""
    noise: Array
    """Standard deviation of the orientations (W,), rad."""
    span: Array
    """Time between the frames (W,), s."""

    @staticmethod
    def unread(worlds: int, pucks: int) -> MarkReadings:
        """Return the readings of pucks without a mark."""
        angle, spin = np.zeros((2, worlds, pucks))
        read = np.zeros((worlds, pucks), np.bool_)
        return MarkReadings(angle, spin, read, np.ones(worlds), np.full(worlds, FRAME))


class PuckMarks:
    """Marks of the pucks of B worlds.

    Args:
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        steps: Number of stored control steps, for the latency of the camera.
        control_dt: Length of a control step, s.
    """

    def __init__(
        self, scene: Scene, num_worlds: int, steps: int, control_dt: float
    ) -> None:
        self._pucks, self._dt = scene.bodies.puck, control_dt
        stored = steps + int(np.ceil(FRAME / control_dt))
        self._past = np.zeros((num_worlds, stored, scene.bodies.pucks, 2))
        """Orientations, rad, and spins, rad/s, at control steps."""

    @staticmethod
    def exist(physics: Physics) -> bool:
        """Return True if pucks have marks."""
        return physics.any_of("angle_noise")

    def reset(self, worlds: Array, state: State) -> None:
        """Replace the past in some worlds (W,) by that of pucks at constant spin."""
        spin = state.spin[worlds, self._pucks]
        ago = self._dt * np.arange(self._past.shape[1], 0, -1)[:, None]
        self._past[worlds, ..., 0] = (
            state.angle[worlds, None, self._pucks] - ago * spin[:, None]
        )
        self._past[worlds, ..., 1] = spin[:, None]

    def look(
        self,
        worlds: Array,
        state: State,
        taken: Array,
        fresh: Array,
        values: Mapping[str, Array],
        streams: StreamSet,
    ) -> MarkReadings:
        """Return the readings that the newest frames show.

        Args:
            worlds: Indices (W,) of the worlds.
            state: State of all B worlds.
            taken: Times of the frames (W,), s.
            fresh: True for pucks that are visible in a new frame (W, pucks).
            values: Physical parameters (B,) by name.
            streams: Random streams of the worlds, including `STREAM`.
        """
        pucks = self._past.shape[2]
        readings = MarkReadings.unread(len(worlds), pucks)
        units = streams.of(STREAM, worlds).units(3, pucks)
        readings.noise[:] = values["angle_noise"][worlds]
        dropout = values["angle_dropout"]
        true = state.angle[:, self._pucks], state.spin[:, self._pucks], state.time
        _look(
            worlds, units, *true, taken, fresh, dropout, self._past, self._dt, readings
        )
        return readings


@compiled(nogil=True, error_model="numpy")
def _look(
    worlds: Array,
    units: Array,
    angle: Array,
    spin: Array,
    now: Array,
    taken: Array,
    fresh: Array,
    dropout: Array,
    past: Array,
    dt: float,
    readings: MarkReadings,
) -> None:
    """Fill ``readings`` and append to ``past``, see `PuckMarks.look`."""
    newest = np.empty(2)
    for row in range(len(worlds)):
        w, age = worlds[row], now[worlds[row]] - taken[row]
        for k in range(past.shape[2]):
            newest[0], newest[1] = angle[w, k], spin[w, k]
            append(past[w, :, k], newest)
            first, second = normal_pair(units[row, 0, k], units[row, 1, k])
            seen = _angle_before(past[w, :, k], age, dt) + readings.noise[row] * first
            old = (
                _angle_before(past[w, :, k], age + FRAME, dt)
                + readings.noise[row] * second
            )
            readings.angle[row, k] = wrapped(seen)
            readings.spin[row, k] = wrapped(seen - old) / FRAME
            readings.read[row, k] = fresh[row, k] and units[row, 2, k] >= dropout[w]


@compiled(nogil=True, error_model="numpy")
def wrapped(angle: float) -> float:
    """Return an angle between -`PERIOD` / 2 and `PERIOD` / 2, rad."""
    return float(angle - PERIOD * np.floor(angle / PERIOD + 0.5))


@inner(error_model="numpy")
def _angle_before(past: Array, delay: float, dt: float) -> float:
    """Return the orientation of a puck ``delay`` s before its last sample, rad.

    As in `delay.position_before`, the spin changes at one time within a step.
    """
    before, after, share = around(len(past), delay / dt)
    older, newer = past[before], past[after]
    change = older[1] - newer[1]
    gap = newer[0] - older[0] - newer[1] * dt
    kink = gap / change if abs(change) > 1e-9 else 0.5 * dt
    since = share * dt
    if since < kink:
        return float(older[0] + older[1] * since)
    return float(newer[0] - newer[1] * (dt - since))
