"""Simulated camera: sensed positions of pucks and blocks, with a camera's errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from marl_airhockey.core.physics import Physics
from marl_airhockey.core.rng import RandomStreams, StreamSet
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.sensing.calibration import CalibrationMap
from marl_airhockey.sensing.contacts import ContactSensor
from marl_airhockey.sensing.delay import TrajectoryDelay
from marl_airhockey.sensing.estimator import Estimator
from marl_airhockey.sensing.occlusion import Occlusion
from marl_airhockey.types import ALL, Array, Rows

SENSED = (
    *("observation_delay", "observation_jitter", "position_noise"),
    *("calibration_error", "occlusion", "false_detection"),
)
"""Names of the physical parameters of sensing."""
PAST = 0.4
"""Time for which the paths of paddles are stored, s"""
SAME_FRAME = 1e-4
"""Largest time between two readings of the same frame (s)."""


class SimulatedCamera:
    """Camera over the tables of B worlds.

    At every step it delivers its newest frame, whose age is the latency of the episode
    and a jitter of the step. A position has a smooth error, fixed for the episode, and
    white noise. A puck near an arm may be hidden: it keeps the position and velocity of
    the last frame in which it was visible. Rarely a puck is detected where it is not.
    A velocity is the difference between the last two frames in which a body was
    visible, over the time between them. Paddles are not seen: robots report them.
    Contacts of pucks with paddles are found in the frames, so they are known late.

    Args:
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        physics: Ranges of the parameters of sensing.
        control_dt: Time of a step, s.
        estimates: Whether a filter estimates the pucks as well.
    """

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        physics: Physics,
        control_dt: float,
        estimates: bool,
    ) -> None:
        self.control_dt = control_dt
        self.tracked = slice(scene.bodies.paddles, scene.bodies.movers)
        """Indices of the bodies that it sees: pucks and blocks."""
        self.pucks, self._puck_radius = scene.bodies.pucks, scene.table.puck_radius
        count = self.tracked.stop - self.tracked.start
        shape = (num_worlds, count, 2)
        longest = physics.highest("observation_delay")
        longest += physics.highest("observation_jitter")
        self.delay = TrajectoryDelay(longest, control_dt, shape[:2])
        self._extent = np.abs(np.asarray(scene.table.vertices)).max(0)
        self._map = CalibrationMap(num_worlds, 2 * self._extent[1])
        self._maps = physics.any_of("calibration_error")
        self._occlusion = Occlusion(scene, num_worlds, control_dt)
        self._hides = physics.any_of("occlusion")
        self._errs = physics.any_of("false_detection")
        estimator = Estimator(scene, num_worlds, physics, control_dt)
        self._estimator = estimator if estimates else None
        self._contacts = ContactSensor(scene, num_worlds, control_dt)
        stored = max(round(PAST / control_dt), 2)
        self._paddles = np.zeros((num_worlds, stored, scene.bodies.paddles, 2))
        self._position, self._velocity = np.zeros(shape), np.zeros(shape)
        self._taken = np.zeros((num_worlds, count))
        """Time of the last frame in which a body was visible, s"""
        self._visible = np.ones((num_worlds, self.pucks), np.bool_)

    def begin(
        self, worlds: Array, values: Mapping[str, Array], streams: StreamSet
    ) -> None:
        """Sample what is fixed for an episode in some worlds; call `reset` after it.

        Args:
            worlds: Indices (W,) of the worlds.
            values: Physical parameters by name, (B,) each.
            streams: Streams of the worlds, "sensor" among them.
        """
        if self._maps:
            sd = values["calibration_error"][worlds]
            self._map.sample(streams.of("sensor", worlds), sd, worlds)

    def reset(self, worlds: Array, state: State, values: Mapping[str, Array]) -> None:
        """Replace the past in some worlds by that of bodies at constant velocity.

        Args:
            worlds: Indices (W,) of the worlds.
            state: State of all B worlds.
            values: Physical parameters by name, (B,) each.
        """
        position = state.position[worlds, self.tracked]
        velocity, dt = state.velocity[worlds, self.tracked], self.control_dt
        self.delay.fill(worlds, _past(position, velocity, self.delay.depth, dt))
        age = values["observation_delay"][worlds] + self.control_dt
        seen = position - velocity * age[:, None, None]
        self._position[worlds] = self._map.shifted(seen, worlds)
        self._velocity[worlds] = velocity
        self._taken[worlds] = (state.time[worlds] - age)[:, None]
        self._visible[worlds] = True
        self._occlusion.reset(worlds)
        if self._estimator is not None:
            pucks = slice(0, self.pucks)
            self._estimator.reset(
                worlds,
                self._position[worlds, pucks],
                velocity[:, pucks],
                self._taken[worlds, pucks],
            )
        self._contacts.reset(worlds, self._tracks[worlds])
        self._paddles[worlds] = state.paddle[worlds, None]

    @property
    def estimates(self) -> bool:
        """True if a filter estimates the pucks."""
        return self._estimator is not None

    @property
    def _tracks(self) -> Array:
        """(B, pucks, 5) time, s, position, m, velocity, m/s, in the last frames."""
        if self._estimator is not None:
            return self._estimator.tracks
        pucks = slice(0, self.pucks)
        seen = self._position[:, pucks], self._velocity[:, pucks]
        return np.concatenate([self._taken[:, pucks, None], *seen], -1)

    def look(
        self,
        state: State,
        values: Mapping[str, Array],
        streams: StreamSet,
        rows: Rows = ALL,
    ) -> tuple[State, Array]:
        """Return the sensed state of all worlds; time has passed in ``rows`` alone.

        Returns:
            The state as the camera sees it, and the ages of the pucks' positions,
            (B, pucks), s.
        """
        self._update(state, values, streams.of("sensor").select(rows), rows)
        position, velocity = state.position.copy(), state.velocity.copy()
        position[:, self.tracked] = self._position
        velocity[:, self.tracked] = self._velocity
        # A camera sees the centre of a puck, not its spin.
        spin = state.spin.copy()
        spin[:, self.tracked] = 0.0
        visible = state.visible & self._visible
        found = self._contacts
        sensed = replace(
            state,
            position=position,
            velocity=velocity,
            spin=spin,
            visible=visible,
            touched=found.touched.copy(),
            touched_at=found.touched_at.copy(),
            touching=found.touching.copy(),
        )
        return sensed, state.time[:, None] - self._taken[:, : self.pucks]

    def estimated(self, sensed: State) -> State:
        """Return a sensed state with the estimates of the pucks for now.

        Raises:
            RuntimeError: It was made without ``estimates``.
        """
        if self._estimator is None:
            raise RuntimeError("pucks are not estimated; make it with estimates=True")
        found, puck = self._estimator.now, sensed.bodies.puck
        position, velocity = sensed.position.copy(), sensed.velocity.copy()
        spin = sensed.spin.copy()
        position[:, puck], velocity[:, puck] = found[..., :2], found[..., 2:4]
        spin[:, puck] = found[..., 4] / self._puck_radius
        return replace(sensed, position=position, velocity=velocity, spin=spin)

    def _update(
        self,
        state: State,
        values: Mapping[str, Array],
        rng: RandomStreams,
        rows: Rows,
    ) -> None:
        """Update the sensed positions and velocities in some worlds by a frame."""
        age = values["observation_delay"][rows]
        age = age + values["observation_jitter"][rows] * rng.uniform(0.0, 1.0)
        now = state.position[rows, self.tracked], state.velocity[rows, self.tracked]
        then = self.delay.push_sample(np.concatenate(now, -1), age, rows)
        seen = self._map.shifted(then, rows) if self._maps else then.copy()
        noise = values["position_noise"][rows][:, None, None]
        seen += noise * rng.normal(*seen.shape[1:])
        visible = np.ones((len(seen), seen.shape[1]), np.bool_)
        found = visible[:, : self.pucks]
        if self._hides:
            arms, share = state.paddle[rows], values["occlusion"][rows]
            pucks = then[:, : self.pucks]
            found[:] = self._occlusion.sample_visible(pucks, arms, share, rng, rows)
        if self._errs:
            wrong = rng.uniform(0.0, 1.0, self.pucks)
            wrong = wrong < values["false_detection"][rows][:, None]
            elsewhere = self._extent * rng.uniform(-1.0, 1.0, self.pucks, 2)
            np.copyto(seen[:, : self.pucks], elsewhere, where=wrong[..., None])
            found |= wrong
        taken = (state.time[rows] - age)[:, None]
        since = taken - self._taken[rows]
        fresh = visible & (since > SAME_FRAME)
        last, velocity = self._position[rows], self._velocity[rows]
        moved = (seen - last) / np.maximum(since, SAME_FRAME)[..., None]
        self._velocity[rows] = np.where(fresh[..., None], moved, velocity)
        self._position[rows] = np.where(fresh[..., None], seen, last)
        self._taken[rows] = np.where(fresh, taken, self._taken[rows])
        self._visible[rows] = found
        paddles = self._paddles[rows]
        paddles[:, :-1], paddles[:, -1] = paddles[:, 1:].copy(), state.paddle[rows]
        self._paddles[rows] = paddles
        if self._estimator is not None:
            # Contiguous with and without blocks, so that one version is compiled.
            pucks_of = slice(0, self.pucks)
            self._estimator.update(
                np.arange(len(state.time))[rows],
                np.ascontiguousarray(seen[:, pucks_of]),
                taken[:, 0],
                np.ascontiguousarray(fresh[:, pucks_of]),
                paddles,
                state.time[rows],
            )
        self._contacts.update(self._tracks[rows], paddles, state.time[rows], rows)


def _past(position: Array, velocity: Array, steps: int, control_dt: float) -> Array:
    """Return samples (W, steps, n, 4) of the straight trajectory before a position."""
    ago = np.arange(steps, 0, -1)[:, None, None] * control_dt
    then = position[:, None] - velocity[:, None] * ago
    return np.concatenate([then, np.broadcast_to(velocity[:, None], then.shape)], -1)
