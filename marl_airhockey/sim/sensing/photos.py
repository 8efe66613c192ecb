"""Frames of a camera: the bodies in the middle of exposures, or images of a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from marl_airhockey.sim.contracts.camera_model import CameraModel
from marl_airhockey.sim.core.rng import StreamSet
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.sensing.delay import append, depth, position_before
from marl_airhockey.types import ALL, Array, Rows

STREAM = "camera"
"""Purpose of the random streams of frames."""
LATEST = 3
"""Largest age of the newest frame beyond its latency, in times between frames: a frame
is up to one old when it is read, and up to two frames in a row do not arrive."""


class Photos(ABC):
    """Newest frames of a camera at the last control steps, in B worlds."""

    rows: Array
    """Frames (B, F, ...), the newest last."""

    @abstractmethod
    def take(self, state: State, streams: StreamSet, worlds: Rows = ALL) -> None:
        """Read the newest frame of some worlds.

        Args:
            state: True state of all worlds.
            streams: Random streams, including `STREAM`.
            worlds: Worlds in which time has passed.
        """

    def restart(self, state: State, streams: StreamSet, worlds: Array) -> None:
        """Replace all frames of some worlds (W,) by the first one of an episode."""
        self.take(state, streams, worlds)
        self.rows[worlds] = self.rows[worlds][:, -1:]


class SimulatedPhotos(Photos):
    """Frames of a simulated camera: positions, velocities and angles of all bodies.

    A frame is as old as its latency and the time since it arrived, which is uniformly
    distributed between 0 and the time between two frames. A frame that did not arrive
    is replaced by the one before.

    Args:
        model: Camera above the tables.
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        frames: Number of control steps, F.
        control_dt: Length of a control step, s.
    """

    def __init__(
        self,
        model: CameraModel,
        scene: Scene,
        num_worlds: int,
        frames: int,
        control_dt: float,
    ) -> None:
        self.model, self._dt = model, control_dt
        longest = model.latency + LATEST * model.period
        steps, bodies = depth(longest, control_dt), len(scene.bodies)
        self._past = np.zeros((num_worlds, steps, bodies, 5))
        self.rows = np.zeros((num_worlds, frames, bodies, 5))
        """Positions, m, velocities, m/s, and angles, rad, (B, F, N, 5)."""
        self._all = np.arange(num_worlds)

    def take(self, state: State, streams: StreamSet, worlds: Rows = ALL) -> None:
        indices, model = self._all[worlds], self.model
        units = streams.of(STREAM, indices).units(LATEST)
        times = np.array([model.latency, model.period, model.dropped, self._dt])
        moving = state.position, state.velocity, state.angle
        _take(indices, units, *moving, times, self._past, self.rows)

    def restart(self, state: State, streams: StreamSet, worlds: Array) -> None:
        position, velocity = state.position[worlds, None], state.velocity[worlds, None]
        steps = self._past.shape[1]
        ago = np.arange(steps, 0, -1)[:, None, None] * self._dt
        self._past[worlds, ..., :2] = position - ago * velocity
        self._past[worlds, ..., 2:4] = velocity
        self._past[worlds, ..., 4] = state.angle[worlds, None]
        super().restart(state, streams, worlds)


class TablePhotos(Photos):
    """Frames of the camera of a real table: images (1, F, size, size, 3), RGB.

    Args:
        newest: Function that returns the newest frame (size, size, 3) uint8, RGB.
        size: Width and height of the images, px.
        frames: Number of control steps, F.
    """

    def __init__(self, newest: Callable[[int], Array], size: int, frames: int) -> None:
        self._newest = newest
        self.rows = np.zeros((1, frames, size, size, 3), np.uint8)

    def take(self, state: State, streams: StreamSet, worlds: Rows = ALL) -> None:
        self.rows[:, :-1] = self.rows[:, 1:]
        self.rows[:, -1] = self._newest(self.rows.shape[2])


@compiled(nogil=True, error_model="numpy")
def _take(
    worlds: Array,
    units: Array,
    position: Array,
    velocity: Array,
    angle: Array,
    times: Array,
    past: Any,
    rows: Any,
) -> None:
    """Append the present to the past of some worlds (W,), and a frame to their rows."""
    latency, period, dropped, dt = times
    newest = rows.shape[1] - 1
    for i in range(len(worlds)):
        w, unit = worlds[i], units[i]
        missing = 0
        while missing < LATEST - 1 and unit[1 + missing] < dropped:
            missing += 1
        age = latency + period * (unit[0] + missing)
        for f in range(newest):
            rows[w, f] = rows[w, f + 1]
        append(past[w, :, :, :2], position[w])
        append(past[w, :, :, 2:4], velocity[w])
        append(past[w, :, :, 4], angle[w])
        step = min(int(age / dt), past.shape[1] - 1)
        for n in range(past.shape[2]):
            x, y = position_before(past[w, :, n], age, dt)
            rows[w, newest, n, 0], rows[w, newest, n, 1] = x, y
            for c in range(2, 5):
                rows[w, newest, n, c] = past[w, past.shape[1] - 1 - step, n, c]
