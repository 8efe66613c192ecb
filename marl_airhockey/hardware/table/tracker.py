"""Tracker of the puck's state by camera sightings and reported paddle positions."""

from __future__ import annotations

import time

import numpy as np

from marl_airhockey.hardware.table.events import MeasuredPuck, find_contacts
from marl_airhockey.hardware.table.innovations import Innovations
from marl_airhockey.hardware.vision import Sighting
from marl_airhockey.hardware.vision.mark import NOISE
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.sensing.estimator import Estimator
from marl_airhockey.sim.sensing.frame import Newest
from marl_airhockey.sim.sensing.puck_mark import MarkReadings, wrapped
from marl_airhockey.types import Array

SPACING, PAST = 0.01, 40
"""Time between two samples of the paddle's path, s, and number of past samples."""
APART = 0.045
"""Longest time between two sightings that measure a spin, s. In a period of a camera
with 30 frames/s, a puck with up to 47 rad/s turns by less than a quarter, so that its
mark is not ambiguous."""
SMOOTHED = 0.05
"""Weight of the newest sighting in the mean distance from the estimate."""
WORLD = np.zeros(1, np.int64)
"""Index of the one world."""
UNREAD = MarkReadings.unread(1, 1)
"""Readings of a puck without a visible mark."""


class Tracker:
    """Tracker of the puck of one table.

    Args:
        scene: Scene on the table.
        physics: Ranges of the table's physical parameters.
    """

    def __init__(self, scene: Scene, physics: Physics) -> None:
        self._scene = scene
        self._estimator = Estimator(scene, 1, physics, SPACING)
        self._touching = False
        self._last_angle: tuple[float, float] = (-np.inf, np.nan)
        """Time, s, and orientation, rad, of the last sighting."""
        self._trail: list[Array] = []
        """Filtered x, y, m, and vx, vy, m/s, since the last call of `fill`, oldest
        first. The first one is the newest of the call before."""
        self.last: MeasuredPuck | None = None
        """Newest sighting, filtered; None before an episode begins."""
        self.noise = 0.0
        """Mean distance of the sightings from the filtered positions, m."""
        self.innovations = Innovations()
        """Distances of the sightings from their predictions."""
        if scene.pucks:
            # Compiles filter and contacts before an episode begins.
            first, later = (
                Sighting(np.zeros(2), t, 1.0, np.zeros(2)) for t in (0, 0.1)
            )
            self.begin([first])
            self._follow(scene.still_state(1), later, np.zeros((2, 3)), 0.1, 0.0)
        self.forget()

    def forget(self) -> None:
        """Forget the puck until the next episode begins."""
        self.last, self._touching, self.noise = None, False, 0.0
        self._last_angle = -np.inf, np.nan
        self.innovations.restart()

    def begin(self, seen: list[Sighting]) -> None:
        """Begin an episode with the first sightings of the puck, oldest first."""
        first, last = seen[0], seen[-1]
        velocity = (last.place - first.place) / max(last.taken - first.taken, 1e-3)
        self._estimator.reset(
            WORLD,
            last.place.reshape(1, 1, 2),
            velocity.reshape(1, 1, 2),
            np.full((1, 1), last.taken),
        )
        self.last = MeasuredPuck(last.taken, last.place, velocity)
        self._trail = [np.concatenate([last.place, velocity])]

    @property
    def estimate(self) -> Array | None:
        """Estimated x, y, m, and vx, vy, m/s, of the puck (4,); None without a puck."""
        return None if self.last is None else self._estimator.now[0, 0, :4].copy()

    def fill(
        self,
        state: State,
        seen: list[Sighting],
        track: Array,
        now: float,
        since: float,
    ) -> None:
        """Fill a state with the present estimate of the puck and its contacts.

        Its path, if it has one, ends at the newest sighting and not now: a prediction
        must not decide a success.

        Args:
            state: State of one world, without contacts.
            seen: Sightings since the last call, oldest first.
            track: Times, s, and positions, m, of the paddle (n, 3).
            now: Time of the state, s.
            since: Time at which the step began, s.
        """
        for sighting in seen:
            self._follow(state, sighting, track, now, since)
        self._update(np.zeros(2), 0.0, False, track, now)
        seats = self._scene.bodies.paddles
        x, y, vx, vy, edge = self._estimator.now[0, 0, :5]
        state.position[0, seats] = x, y
        state.velocity[0, seats] = vx, vy
        state.spin[0, seats] = edge / self._scene.table.puck_radius
        state.touching[0, 0, 0] = self._touching
        if state.path is not None:
            self._fill_path(state, state.path[0])

    def _fill_path(self, state: State, path: Array) -> None:
        """Fill a path (rows, movers, 4) with the trail of the puck, and shorten it."""
        movers = len(path[0])
        path[..., :2], path[..., 2:] = (
            state.position[0, :movers],
            state.velocity[0, :movers],
        )
        rows = np.linspace(0, len(self._trail) - 1, len(path)).round().astype(int)
        path[:, self._scene.bodies.paddles] = np.array(self._trail)[rows]
        del self._trail[:-1]

    def _extend_trail(self, begin: float, end: float, track: Array) -> None:
        """Extend the trail from one sighting to the time of the next one, s."""
        for moment in np.arange(begin + SPACING, end, SPACING):
            self._update(np.zeros(2), 0.0, False, track, float(moment))
            self._trail.append(self._estimator.now[0, 0, :4].copy())

    def _follow(
        self,
        state: State,
        sighting: Sighting,
        track: Array,
        now: float,
        since: float,
    ) -> None:
        """Update the estimate by a sighting and add the puck's contacts before it."""
        last, taken = self.last, sighting.taken
        if last is not None and taken <= last.time:
            return
        if last is not None:
            self._extend_trail(last.time, taken, track)
            self._update(np.zeros(2), 0.0, False, track, taken)
            off = sighting.place - self._estimator.now[0, 0, :2]
            self.innovations.add(off, taken - last.time)
        # The filtered position at the time of the frame itself.
        readings = self._readings(sighting)
        self._update(sighting.place, taken, True, track, taken, readings)
        found = self._estimator.now[0, 0]
        self._trail.append(found[:4].copy())
        new = self.last = MeasuredPuck(taken, found[:2].copy(), found[2:4].copy())
        apart = float(np.linalg.norm(new.place - sighting.place))
        self.noise += SMOOTHED * (apart - self.noise)
        if last is None:
            return
        met = find_contacts(self._scene, last, new, track[:, 0], track[:, 1:])
        touching = bool(np.isfinite(met.paddle_at))
        if touching and not self._touching:
            state.touched[0, 0, 0] += 1
            # Negative for a contact before this step, which was observed with latency.
            state.touched_at[0, 0, 0] = min(met.paddle_at, now) - since
        self._touching = touching
        state.banked[0, 0] += met.banks
        for k, line in enumerate(self._scene.goal_lines):
            if line.width is None and met.banks[line.side]:
                state.crossed[0, 0, k] = True
                state.crossed_velocity[0, 0, k] = met.velocity

    def _readings(self, sighting: Sighting) -> MarkReadings:
        """Return orientation and spin of the puck, by this sighting and the last."""
        before, self._last_angle = self._last_angle, (sighting.taken, sighting.angle)
        since, readings = sighting.taken - before[0], MarkReadings.unread(1, 1)
        change = sighting.angle - before[1]
        if np.isfinite(change) and since < APART:
            readings.angle[:], readings.spin[:] = (
                sighting.angle,
                wrapped(change) / since,
            )
            readings.noise[:], readings.span[:], readings.read[:] = NOISE, since, True
        return readings

    def _update(
        self,
        position: Array,
        taken: float,
        fresh: bool,
        track: Array,
        now: float,
        readings: MarkReadings = UNREAD,
    ) -> None:
        at = now - SPACING * np.arange(PAST, -1, -1)
        path = np.stack([np.interp(at, track[:, 0], track[:, k]) for k in (1, 2)], -1)
        self._estimator.update(
            WORLD,
            Newest(
                position.reshape(1, 1, 2), np.full(1, taken), np.full((1, 1), fresh)
            ),
            readings,
            path.reshape(1, -1, 1, 2),
            np.full(1, now),
        )

    def sight(self, looked_at: float) -> Array:
        """Return x, y, m, visibility and age, s, of the pucks (1, pucks, 4).

        Args:
            looked_at: Time at which the newest frame was taken, s.
        """
        last, age, position, visible = self.last, 0.0, np.zeros(2), 0.0
        if last is not None:
            age, position = time.monotonic() - last.time, last.place
            visible = float(looked_at - last.time < 1e-3)
        row = np.array([*position, visible, age]).reshape(1, 1, 4)
        return np.repeat(row, self._scene.pucks, axis=1)
