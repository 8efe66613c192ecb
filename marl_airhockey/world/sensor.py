"""Sensor: states as a camera sees them, late, noisy, occluded, with their history.

A camera sees pucks and blocks; paddles report themselves, as robots do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from marl_airhockey.contracts.observable import FRAMES, HISTORY, PENDING
from marl_airhockey.core.estimator import Estimator
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.rng import RandomStreams, StreamSet
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.types import Array
from marl_airhockey.world.calibration import CalibrationMap
from marl_airhockey.world.delay import ALL, Rows, WayDelay
from marl_airhockey.world.occlusion import Occlusion

SENSED = (
    *("observation_delay", "observation_jitter", "position_noise"),
    *("calibration_error", "occlusion", "false_detection"),
)
"""Names of the physical parameters of sensing."""
SAME_FRAME = 1e-4
"""Frames that are no more than this apart are one (s)."""


class Sensor:
    """Sensor of B worlds, which turns states into sensed states.

    At every step it looks at the newest frame of the camera, as old as the delay of the
    episode and a jitter of the step. What it sees lies off by a smooth map, fixed for
    the episode, and by white noise. A puck near an arm may be hidden: it stays where it
    was seen last, at the velocity that it had. Rarely a puck is seen where it is not.
    A velocity is the way between the last two frames in which a body was seen, over the
    time between them.

    Args:
        scene: who is on the table.
        num_worlds: B.
        physics: says how much of all this there can be.
        control_dt: s.
    """

    def __init__(
        self, scene: Scene, num_worlds: int, physics: Physics, control_dt: float
    ) -> None:
        self.ideal = not physics.any_of(*SENSED)
        self.control_dt = control_dt
        self.camera = slice(scene.bodies.paddles, scene.bodies.movers)
        """Bodies that the camera sees."""
        self.pucks, self._puck_radius = scene.bodies.pucks, scene.table.puck_radius
        count = self.camera.stop - self.camera.start
        things = (num_worlds, count, 2)
        longest = physics.highest("observation_delay")
        longest += physics.highest("observation_jitter")
        self.delay = WayDelay(longest, control_dt, things[:2])
        self._extent = np.abs(np.asarray(scene.table.vertices)).max(0)
        self._map = CalibrationMap(num_worlds, 2 * self._extent[1])
        self._maps = physics.any_of("calibration_error")
        self._occlusion = Occlusion(scene, num_worlds, control_dt)
        self._hides = physics.any_of("occlusion")
        self._errs = physics.any_of("false_detection")
        self._estimator = Estimator(scene, num_worlds, physics, control_dt)
        self._position, self._speed = np.zeros(things), np.zeros(things)
        self._taken = np.zeros((num_worlds, count))
        """Time at which the frame was taken in which a body was seen last, s"""
        self._visible = np.ones((num_worlds, self.pucks), np.bool_)
        self.history = np.zeros((num_worlds, HISTORY, self.pucks, 4))
        """(B, HISTORY, pucks, 4) sensed x, y, visibility and age (s), newest last."""
        self.frames = np.zeros((num_worlds, FRAMES, len(scene.bodies), 2))
        """(B, FRAMES, N, 2) sensed positions of all bodies, newest last."""
        self.asked = np.zeros((num_worlds, PENDING, scene.bodies.paddles, 2))
        """(B, PENDING, seats, 2) last actions asked for, in ego frames, newest last."""
        self.keeps_history = False
        """True if these three are kept, as an observation needs them."""
        self.estimates = False
        """True if pucks are estimated, as an observation needs it."""
        self.sight: Callable[[], Array] | None = None
        """What a real camera sees, see `Backend.sight`; None for a simulated one."""

    def past(self, rows: Rows = ALL) -> dict[str, Array]:
        """Return ``history`` and ``asked`` of some worlds, by name."""
        return {"history": self.history[rows], "asked": self.asked[rows]}

    def estimated(self, sensed: State, rows: Rows = ALL) -> State:
        """Return a sensed state of some worlds with pucks as they are estimated now."""
        if self.ideal:
            return sensed
        found, puck = self._estimator.now[rows], sensed.bodies.puck
        position, velocity = sensed.position.copy(), sensed.velocity.copy()
        spin = sensed.spin.copy()
        position[:, puck], velocity[:, puck] = found[..., :2], found[..., 2:4]
        spin[:, puck] = found[..., 4] / self._puck_radius
        return replace(sensed, position=position, velocity=velocity, spin=spin)

    def note(self, actions: Array) -> None:
        """Take note of the actions (B, seats, 2) that are asked for in a step."""
        self.asked[:, :-1], self.asked[:, -1] = self.asked[:, 1:], actions

    def begin(
        self, worlds: Array, values: dict[str, Array], streams: StreamSet
    ) -> None:
        """Draw what holds for an episode in some worlds; `reset` comes after it."""
        self.asked[worlds] = 0.0
        if self._maps:
            sd = values["calibration_error"][worlds]
            self._map.draw(streams.of("sensor", worlds), sd, worlds)

    def reset(
        self, worlds: Array, state: State, values: dict[str, Array], streams: StreamSet
    ) -> State:
        """Forget what was seen in some worlds; return the sensed state.

        The past is that of bodies that have moved at their velocities.

        Args:
            worlds: (W,) their indices.
            state: of all B worlds.
            values: physical parameters, (B,) each.
            streams: those of the worlds, for "sensor" too.
        """
        if not self.ideal:
            position = state.position[worlds, self.camera]
            velocity, dt = state.velocity[worlds, self.camera], self.control_dt
            self.delay.fill(worlds, _past(position, velocity, self.delay.depth, dt))
            age = values["observation_delay"][worlds] + self.control_dt
            place = position - velocity * age[:, None, None]
            self._position[worlds] = self._map.shifted(place, worlds)
            self._speed[worlds] = velocity
            self._taken[worlds] = (state.time[worlds] - age)[:, None]
            self._visible[worlds] = True
            self._occlusion.reset(worlds)
            if self.estimates:
                pucks = slice(0, self.pucks)
                self._estimator.reset(
                    worlds,
                    self._position[worlds, pucks],
                    velocity[:, pucks],
                    self._taken[worlds, pucks],
                    state.paddle[worlds],
                )
        sensed = self.sense(state, values, streams, worlds)
        if self.keeps_history:
            self.history[worlds] = self.history[worlds][:, -1:]
            self.frames[worlds] = self.frames[worlds][:, -1:]
        return sensed

    def sense(
        self,
        state: State,
        values: dict[str, Array],
        streams: StreamSet,
        rows: Rows = ALL,
    ) -> State:
        """Return the sensed state; time has passed in the worlds ``rows`` alone."""
        if self.ideal and not self.keeps_history:
            return state
        sensed, age = state, np.zeros((len(state.time), self.pucks))
        if not self.ideal:
            rng = streams.of("sensor").select(rows)
            self._look(state, values, rng, rows)
            position, velocity = state.position.copy(), state.velocity.copy()
            position[:, self.camera] = self._position
            velocity[:, self.camera] = self._speed
            # A camera sees the middle of a puck, not how it turns.
            spin = state.spin.copy()
            spin[:, self.camera] = 0.0
            sensed = replace(
                state,
                position=position,
                velocity=velocity,
                spin=spin,
                visible=state.visible & self._visible,
            )
            age = state.time[:, None] - self._taken[:, : self.pucks]
        if self.keeps_history:
            if self.sight is None:
                seen = np.stack([sensed.visible, age], -1)
                newest = np.concatenate([sensed.puck, seen], -1)
            else:
                newest = self.sight()
            for kept, new in ((self.history, newest), (self.frames, sensed.position)):
                past = kept[rows]
                kept[rows] = np.concatenate([past[:, 1:], new[rows][:, None]], 1)
        return sensed

    def _look(
        self, state: State, values: dict[str, Array], rng: RandomStreams, rows: Rows
    ) -> None:
        """Update the sensed positions and speeds of the bodies in some worlds."""
        age = values["observation_delay"][rows]
        age = age + values["observation_jitter"][rows] * rng.uniform(0.0, 1.0)
        places = state.position[rows, self.camera], state.velocity[rows, self.camera]
        place = self.delay.place(np.concatenate(places, -1), age, rows)
        seen = self._map.shifted(place, rows) if self._maps else place.copy()
        noise = values["position_noise"][rows][:, None, None]
        seen += noise * rng.normal(*seen.shape[1:])
        visible = np.ones((len(seen), seen.shape[1]), np.bool_)
        found = visible[:, : self.pucks]
        if self._hides:
            arms, share = state.paddle[rows], values["occlusion"][rows]
            found[:] = self._occlusion.unhidden(
                place[:, : self.pucks], arms, share, rng, rows
            )
        if self._errs:
            wrong = rng.uniform(0.0, 1.0, self.pucks)
            wrong = wrong < values["false_detection"][rows][:, None]
            elsewhere = self._extent * rng.uniform(-1.0, 1.0, self.pucks, 2)
            np.copyto(seen[:, : self.pucks], elsewhere, where=wrong[..., None])
            found |= wrong
        taken = (state.time[rows] - age)[:, None]
        since = taken - self._taken[rows]
        fresh = visible & (since > SAME_FRAME)
        last, speed = self._position[rows], self._speed[rows]
        moved = (seen - last) / np.maximum(since, SAME_FRAME)[..., None]
        self._speed[rows] = np.where(fresh[..., None], moved, speed)
        self._position[rows] = np.where(fresh[..., None], seen, last)
        self._taken[rows] = np.where(fresh, taken, self._taken[rows])
        self._visible[rows] = found
        if self.estimates:
            # Contiguous with and without blocks, so that one version is compiled.
            pucks = slice(0, self.pucks)
            self._estimator.update(
                np.arange(len(state.time))[rows],
                np.ascontiguousarray(seen[:, pucks]),
                taken[:, 0],
                np.ascontiguousarray(fresh[:, pucks]),
                state.paddle[rows],
                state.time[rows],
            )


def _past(position: Array, velocity: Array, steps: int, control_dt: float) -> Array:
    """Return motions (W, steps, n, 4) that led to (W, n, 2) straight, without it."""
    ago = np.arange(steps, 0, -1)[:, None, None] * control_dt
    place = position[:, None] - velocity[:, None] * ago
    return np.concatenate([place, np.broadcast_to(velocity[:, None], place.shape)], -1)
