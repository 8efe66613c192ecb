"""Tracks: recorded trajectories of a puck, split into free flights and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from marl_airhockey.data.exchange.rows import read_rows
from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

SLOWEST_RATE = 50.0
"""Lowest rate of a track, 1/s; flights between wall bounces must last several rows."""
WINDOW = 4
"""Number of rows before and after a contact that are used to find it."""
JUMP = 0.12
"""Least change of velocity that is a contact, m/s; `JUMP_SHARE` is the least share of
the speed."""
JUMP_SHARE = 0.06
SHORTEST = 6
"""Least number of rows of a flight."""
LOST = 0.08
"""Longest time without a row in which a contact is assumed, s."""
OFF = 0.1
"""Largest distance of a puck from the table that a camera may report, m."""
GAP = 0.02
"""Largest distance of a puck from the touched body at a contact, m."""


@dataclass(frozen=True)
class Track:
    """Track of a puck: rows of one recording, table frame."""

    time: Array
    """Times (N,), s."""
    puck: Array
    """Positions (N, 2) of the puck, m."""
    paddle: Array | None
    """Positions (N, 2) of the paddle, m; None if they were not recorded."""


@dataclass(frozen=True)
class Flights:
    """F free flights."""

    seconds: Array
    """Durations (F,), s."""
    velocity: Array
    """Mean velocities (F, 2), m/s."""
    acceleration: Array
    """Mean accelerations (F, 2), m/s2."""


@dataclass(frozen=True)
class Contacts:
    """C contacts between two flights, along and across their normals."""

    side: Array
    """Sides of the table (C,), -1 for hits of a paddle."""
    before: Array
    """Normal speed toward the surface and tangential velocity before (C, 2), m/s,
    relative to the touched body."""
    after: Array
    """Normal speed away from it and tangential velocity after (C, 2), m/s."""


def read_track(path: Path, table: Table, origin: str = "centre") -> Track:
    """Return the track in a CSV file with the header t,x,y[,paddle_x,paddle_y].

    Args:
        path: Path of the file, with times in s and positions in m.
        table: Table of the track.
        origin: Origin of the positions: "centre" of the table, or "corner", the one
            with the least x and y.

    Raises:
        ValueError: A column is missing, a row is not numeric, times do not increase,
            there are too few rows per second, the puck is off the table, or the origin
            is unknown.
    """
    if origin not in ("centre", "corner"):
        raise ValueError(f"--origin: {origin!r}; expected centre or corner")
    values = read_rows(path)
    has_paddle = bool(np.isfinite(values[:, 3:]).any())
    values = values[np.isfinite(values[:, :3]).all(1)]
    steps = np.diff(values[:, 0])
    if len(values) < 2 * SHORTEST or (steps <= 0.0).any():
        raise ValueError(
            f"{path}: {len(values)} rows; expected at least {2 * SHORTEST}, with "
            "increasing times"
        )
    if np.median(steps) > 1.0 / SLOWEST_RATE:
        raise ValueError(
            f"{path}: {1 / np.median(steps):.0f} rows per second; expected at least "
            f"{SLOWEST_RATE:.0f}, to separate contacts"
        )
    low = np.asarray(table.vertices).min(0) if origin == "corner" else np.zeros(2)
    puck, corners = values[:, 1:3] + low, np.asarray(table.vertices)
    inside = (corners.min(0) - OFF < puck) & (puck < corners.max(0) + OFF)
    if not inside.all():
        row = int(np.flatnonzero(~inside.all(1))[0])
        raise ValueError(
            f"{path}: row {row}: the puck at {values[row, 1:3].tolist()} m is off the "
            "table; are the positions in metres, and is --origin right?"
        )
    paddle = values[:, 3:5] + low if has_paddle else None
    return Track(values[:, 0], puck, paddle)


def cut(track: Track, table: Table) -> tuple[Flights, Contacts]:
    """Split a track into flights and the contacts between them."""
    steps = np.diff(track.time)
    breaks = np.flatnonzero(steps > LOST) + 1
    flights: list[tuple[float, Array, Array]] = []
    contacts: list[tuple[int, Array, Array]] = []
    for rows in np.split(np.arange(len(track.time)), breaks):
        last = None
        for piece in _pieces(track, rows):
            fitted = _Flight(track, piece)
            flights.append(fitted.summary())
            if last is not None and fitted.time[0] - last.time[-1] <= LOST:
                contact = _contact(track, table, last, fitted)
                if contact is not None:
                    contacts.append(contact)
            last = fitted
    return (
        Flights(
            np.array([length for length, _, _ in flights]),
            np.array([v for _, v, _ in flights]).reshape(-1, 2),
            np.array([a for _, _, a in flights]).reshape(-1, 2),
        ),
        Contacts(
            np.array([side for side, _, _ in contacts], np.int64),
            np.array([v for _, v, _ in contacts]).reshape(-1, 2),
            np.array([v for _, _, v in contacts]).reshape(-1, 2),
        ),
    )


def _pieces(track: Track, rows: Array) -> list[Array]:
    """Split rows without gaps at contacts; return the pieces that are long enough."""
    count = len(rows) - 2 * WINDOW
    if count < 1:
        return []
    time, puck = track.time[rows], track.puck[rows]
    slopes = np.array(
        [
            _slope(time[i : i + WINDOW + 1], puck[i : i + WINDOW + 1])
            for i in range(len(rows) - WINDOW)
        ]
    )
    jump = slopes[WINDOW:] - slopes[: len(slopes) - WINDOW]
    size = np.hypot(*jump.T)
    speed = np.hypot(*slopes[: len(jump)].T)
    excess = size - np.maximum(JUMP, JUMP_SHARE * speed)
    cuts = [
        i + WINDOW
        for i in np.flatnonzero(excess > 0.0).tolist()
        if size[i] >= size[max(i - WINDOW, 0) : i + WINDOW + 1].max()
    ]
    steps = np.diff(time)
    holes = np.flatnonzero(steps > 1.5 * np.median(steps)) + 1
    pieces = []
    for a, b in pairwise([0, *sorted({*cuts, *holes.tolist()}), len(rows)]):
        # The rows next to a detected contact belong to neither flight.
        first = a + 2 if a in cuts else a
        pieces.append(rows[first : b - 1 if b in cuts else b])
    return [piece for piece in pieces if len(piece) >= SHORTEST]


def _slope(time: Array, place: Array) -> Array:
    """Return the slope (2,) of the line through points, m/s."""
    centred = time - time.mean()
    return np.asarray(centred @ place / (centred @ centred))


class _Flight:
    """Flight: a parabola through some rows of a track."""

    def __init__(self, track: Track, rows: Array) -> None:
        self.rows, self.time = rows, track.time[rows]
        self._middle = float(self.time.mean())
        self._parabola = np.polyfit(self.time - self._middle, track.puck[rows], 2)
        self._line = np.polyfit(self.time - self._middle, track.puck[rows], 1)

    def summary(self) -> tuple[float, Array, Array]:
        """Return duration, s, mean velocity and mean acceleration."""
        length = float(self.time[-1] - self.time[0])
        return length, self._parabola[1], 2.0 * self._parabola[0]

    def at(self, time: float) -> tuple[Array, Array]:
        """Return position and velocity; in a short flight the velocity is constant."""
        since = time - self._middle
        if len(self.rows) < 3 * SHORTEST:
            return self._line[0] * since + self._line[1], self._line[0]
        a, v, x = self._parabola
        return (a * since + v) * since + x, 2.0 * a * since + v


def _contact(
    track: Track, table: Table, one: _Flight, two: _Flight
) -> tuple[int, Array, Array] | None:
    """Return side and velocities of the contact of two flights; None without one."""
    time = 0.5 * float(one.time[-1] + two.time[0])
    (place, before), (_, after) = one.at(time), two.at(time)
    depth = table.normals @ place + table.offsets - table.puck_radius
    near, side = float(depth.min()), int(depth.argmin())
    if track.paddle is not None:
        rows = np.arange(one.rows[-1], two.rows[0] + 1)
        paddle = track.paddle[rows]
        offset = place - paddle.mean(0)
        distance = float(np.hypot(*offset))
        if abs(distance - table.paddle_radius - table.puck_radius) < GAP:
            if near < GAP:
                return None
            motion = _slope(track.time[rows], paddle)
            return (-1, *_split(offset / distance, before - motion, after - motion))
    if near > GAP or np.sort(depth)[1] < 2 * GAP:
        # Hits of a paddle that was not recorded, and corners.
        return None
    return (side, *_split(table.normals[side], before, after))


def _split(normal: Array, before: Array, after: Array) -> tuple[Array, Array]:
    """Return normal speed and tangential velocity (2,), before and after."""
    tangent = np.array([-normal[1], normal[0]])
    return (
        np.array([-normal @ before, tangent @ before]),
        np.array([normal @ after, tangent @ after]),
    )
