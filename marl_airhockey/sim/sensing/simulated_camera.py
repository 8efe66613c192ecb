"""Simulated camera: sensed positions of pucks and blocks, with a camera's errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.rng import StreamSet
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.sensing import frame
from marl_airhockey.sim.sensing.calibration import CalibrationMap
from marl_airhockey.sim.sensing.contacts import ContactSensor
from marl_airhockey.sim.sensing.delay import depth
from marl_airhockey.sim.sensing.estimator import Estimator
from marl_airhockey.sim.sensing.occlusion import bases
from marl_airhockey.sim.sensing.puck_mark import MarkReadings, PuckMarks
from marl_airhockey.types import ALL, Array, Rows

SENSED = (
    *("observation_delay", "observation_jitter", "position_noise"),
    *("calibration_error", "occlusion", "false_detection"),
)
"""Names of the physical parameters of sensing."""
PAST = 0.4
"""Time for which the paths of paddles are stored, s."""


class SimulatedCamera:
    """Camera over the tables of B worlds.

    In every step it returns its newest frame. The age of the frame is the latency of
    the episode plus a jitter of the step. A position has white noise and a smooth error
    that is constant in an episode. A puck near an arm may be hidden. It keeps the
    position and velocity of the last frame in which it was visible. Rarely a puck is
    detected at a wrong position. The filter also uses the orientation of a puck with a
    mark. A velocity is the difference between the last two
    frames in which a body was visible, divided by the time between them. Paddles are
    not observed by the camera, because robots report them. Contacts of pucks with
    paddles are detected in the frames and have their latency.

    Args:
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        physics: Ranges of the parameters of sensing.
        control_dt: Length of a control step, s.
        estimates: True to also estimate the pucks by a filter.
    """

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        physics: Physics,
        control_dt: float,
        estimates: bool,
    ) -> None:
        bodies, table, b = scene.bodies, scene.table, num_worlds
        self.tracked = slice(bodies.paddles, bodies.movers)
        """Indices of the bodies that the camera observes: pucks and blocks."""
        self.pucks, self._puck_radius = bodies.pucks, table.puck_radius
        n = self.tracked.stop - self.tracked.start
        longest = physics.highest("observation_delay")
        longest += physics.highest("observation_jitter")
        extent = np.abs(np.asarray(table.vertices)).max(0)
        self.calibration = CalibrationMap(b, 2 * extent[1])
        stored = max(round(PAST / control_dt), 2)
        self._view = frame.CameraPast(
            past=np.zeros((b, depth(longest, control_dt), n, 4)),
            paddles=np.zeros((b, stored, bodies.paddles, 2)),
            waves=self.calibration.waves,
            unhidden=np.ones((b, self.pucks), np.bool_),
            seen=np.zeros((b, n, 4)),
            taken=np.zeros((b, n)),
            visible=np.ones((b, self.pucks), np.bool_),
            bases=bases(scene),
            extent=extent,
            control_dt=control_dt,
        )
        self._marks = None
        if estimates and PuckMarks.exist(physics):
            steps = self._view.past.shape[1]
            self._marks = PuckMarks(scene, b, steps, control_dt)
        estimator = Estimator(scene, b, physics, control_dt)
        self._estimator = estimator if estimates else None
        self._contacts = ContactSensor(scene, b, control_dt)
        self._all = np.arange(b)

    def begin(
        self, worlds: Array, values: Mapping[str, Array], streams: StreamSet
    ) -> None:
        """Sample the constants of an episode in some worlds; call `reset` afterwards.

        Args:
            worlds: Indices (W,) of the worlds.
            values: Physical parameters (B,) by name.
            streams: Random streams of the worlds, including "sensor".
        """
        sd = values["calibration_error"][worlds]
        self.calibration.sample(streams.of("sensor", worlds), sd, worlds)

    def reset(self, worlds: Array, state: State, values: Mapping[str, Array]) -> None:
        """Replace the past in some worlds by that of bodies at constant velocity.

        Args:
            worlds: Indices (W,) of the worlds.
            state: State of all B worlds.
            values: Physical parameters (B,) by name.
        """
        position = state.position[worlds, self.tracked]
        velocity, view = state.velocity[worlds, self.tracked], self._view
        steps, dt = view.past.shape[1], view.control_dt
        view.past[worlds] = _past(position, velocity, steps, dt)
        view.paddles[worlds] = state.paddle[worlds, None]
        age = values["observation_delay"][worlds] + dt
        then = position - velocity * age[:, None, None]
        view.seen[worlds, :, :2] = self.calibration.shifted(then, worlds)
        view.seen[worlds, :, 2:] = velocity
        view.taken[worlds] = (state.time[worlds] - age)[:, None]
        view.visible[worlds] = view.unhidden[worlds] = True
        if self._estimator is not None:
            seen = view.seen[worlds, : self.pucks]
            taken = view.taken[worlds, : self.pucks]
            self._estimator.reset(worlds, seen[..., :2], seen[..., 2:], taken)
        if self._marks is not None:
            self._marks.reset(worlds, state)
        self._contacts.reset(worlds, *self._tracks)

    @property
    def estimates(self) -> bool:
        """True if a filter estimates the pucks."""
        return self._estimator is not None

    @property
    def _tracks(self) -> tuple[Array, Array]:
        """Times of the last frames of the bodies; positions and velocities in them."""
        if self._estimator is not None:
            return self._estimator.tracks
        return self._view.taken, self._view.seen

    def look(
        self,
        state: State,
        values: Mapping[str, Array],
        streams: StreamSet,
        rows: Rows = ALL,
    ) -> tuple[State, Array]:
        """Return the sensed state of all worlds. Time has passed only in ``rows``.

        Returns:
            The sensed state, and the ages of the pucks' positions (B, pucks), s.
        """
        self._update(state, values, streams, rows)
        view, position = self._view, state.position.copy()
        velocity = state.velocity.copy()
        position[:, self.tracked] = view.seen[..., :2]
        velocity[:, self.tracked] = view.seen[..., 2:]
        # A camera detects the centre of a puck, but not its spin.
        spin = state.spin.copy()
        spin[:, self.tracked] = 0.0
        visible = state.visible & view.visible
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
        return sensed, state.time[:, None] - view.taken[:, : self.pucks]

    def estimated(self, sensed: State) -> State:
        """Return a sensed state with the estimates of the pucks for now.

        Raises:
            RuntimeError: The camera was created without ``estimates``.
        """
        if self._estimator is None:
            raise RuntimeError("pucks are not estimated: create it with estimates=True")
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
        streams: StreamSet,
        rows: Rows,
    ) -> None:
        """Update the sensed bodies in some worlds by a frame."""
        view, worlds, now = self._view, self._all[rows], state.time
        w, n = len(worlds), view.seen.shape[1]
        units = streams.of("sensor", worlds).units(frame.numbers(n, self.pucks))
        errors = frame.Errors(*(values[name] for name in frame.Errors._fields))
        newest = frame.Newest(
            np.empty((w, n, 2)), np.empty(w), np.empty((w, n), np.bool_)
        )
        true = state.position, state.velocity, now
        frame.take(worlds, units, *true, errors, view, newest)
        if self._estimator is not None:
            readings = MarkReadings.unread(w, self.pucks)
            if self._marks is not None:
                fresh = newest.taken, newest.fresh[:, : self.pucks]
                readings = self._marks.look(worlds, state, *fresh, values, streams)
            self._estimator.update(worlds, newest, readings, view.paddles, now)
        self._contacts.update(worlds, *self._tracks, view.paddles, now)


def _past(position: Array, velocity: Array, steps: int, control_dt: float) -> Array:
    """Return samples (W, steps, n, 4) of the straight trajectory before a position."""
    ago = np.arange(steps, 0, -1)[:, None, None] * control_dt
    then = position[:, None] - velocity[:, None] * ago
    return np.concatenate([then, np.broadcast_to(velocity[:, None], then.shape)], -1)
