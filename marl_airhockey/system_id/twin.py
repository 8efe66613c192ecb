"""Simulation of a track on a table with known physics parameters.

The difference between the parameters that a fit finds in a simulated track and the
known ones is the error of the fit. The fit approximates a flight by a parabola and the
path into a bounce by a straight line, and both contain noise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from marl_airhockey.sim.backends.numba.backend import NumbaBackend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import Table
from marl_airhockey.system_id.track import LOST, SHORTEST, Track
from marl_airhockey.types import Array

LONGEST = 3.0
"""Time after which the simulation starts again from the track, s, as both diverge."""


def track_twin(
    track: Track,
    table: Table,
    laws: Mapping[str, float],
    noise: float,
    rng: np.random.Generator,
) -> Track:
    """Simulate a track with known physics parameters.

    The simulation starts at pieces of the recorded track, and paddles move as recorded.

    Args:
        track: Track on a real table.
        table: Table of the track.
        laws: Values of parameters, by name. Others are in the middle of the ranges that
            were measured on real tables.
        noise: Standard deviation of a position, m.
        rng: Random generator of the noise and of the contact noise.
    """
    pieces = _pieces(track)
    period = float(np.median(np.diff(track.time)))
    length = max(len(rows) for rows in pieces)
    scene = Scene(table, (make_seat("arcade", table, 0),), pucks=1)
    backend = NumbaBackend(scene, len(pieces), period)
    worlds = np.arange(len(pieces))
    backend.set_physics(_physics(scene, laws, len(pieces)), worlds)
    backend.key_scatter(rng.integers(0, 2**63, len(pieces), np.uint64), worlds)
    state = scene.still_state(len(pieces))
    begins = [_start(track, rows) for rows in pieces]
    state.position[:, scene.bodies.puck.start] = [place for place, _ in begins]
    state.velocity[:, scene.bodies.puck.start] = [speed for _, speed in begins]
    paddles = np.stack([_paddle(track, rows, length, period) for rows in pieces])
    state.position[:, 0] = np.where(
        np.isfinite(paddles[:, 0, :2]), paddles[:, 0, :2], state.position[:, 0]
    )
    backend.reset(state, worlds)
    places = np.empty((len(pieces), length, 2))
    for k in range(length):
        places[:, k] = state.puck[:, 0]
        command = Command.still(scene, len(pieces))
        seen = np.isfinite(paddles[:, k]).all(1)
        command.prescribed[seen, 0] = paddles[seen, k]
        command.raised[:, 0] = ~seen
        state = backend.step(command)
    places += rng.normal(0.0, noise, places.shape)
    return _joined(track, pieces, places, paddles, period)


def _pieces(track: Track) -> list[Array]:
    """Return the rows of pieces without gaps, none longer than `LONGEST`."""
    breaks = np.flatnonzero(np.diff(track.time) > LOST) + 1
    pieces = []
    for rows in np.split(np.arange(len(track.time)), breaks):
        since = track.time[rows] - track.time[rows[0]]
        parts = np.split(rows, np.flatnonzero(np.diff(since // LONGEST)) + 1)
        pieces += [part for part in parts if len(part) >= 2 * SHORTEST]
    return pieces


def _start(track: Track, rows: Array) -> tuple[Array, Array]:
    """Return position and velocity (2,) at the first row of a piece."""
    first = rows[:SHORTEST]
    since = track.time[first] - track.time[first[0]]
    line = np.polyfit(since, track.puck[first], 1)
    return line[1], line[0]


def _paddle(track: Track, rows: Array, length: int, period: float) -> Array:
    """Return position and velocity (length, 4) of the paddle in a piece."""
    if track.paddle is None:
        return np.full((length, 4), np.nan)
    times = track.time[rows[0]] + period * np.arange(1, length + 1)
    place = np.stack(
        [np.interp(times, track.time, track.paddle[:, axis]) for axis in (0, 1)], 1
    )
    return np.column_stack([place, np.gradient(place, period, axis=0)])


def _physics(scene: Scene, laws: Mapping[str, float], worlds: int) -> dict[str, Array]:
    """Return a value of each parameter for each world."""
    ranges = Physics(scene.defaults, "ur5e").ranges
    middle = {name: 0.5 * (low + high) for name, (low, high) in ranges.items()}
    return {k: np.full(worlds, v) for k, v in {**middle, **laws}.items()}


def _joined(
    track: Track, pieces: list[Array], places: Array, paddles: Array, period: float
) -> Track:
    """Return pieces one after the other, with gaps between them, as one track."""
    times, pucks, moved = [], [], []
    began = 0.0
    for k, rows in enumerate(pieces):
        count = len(rows)
        times.append(began + period * np.arange(count))
        pucks.append(places[k, :count])
        moved.append(paddles[k, :count, :2])
        began = times[-1][-1] + 2 * LOST
    paddle = None if track.paddle is None else np.concatenate(moved)
    return Track(np.concatenate(times), np.concatenate(pucks), paddle)
