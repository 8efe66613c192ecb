"""Sensor: states as a camera sees them, late, noisy, occluded, with their history.

A camera sees pucks and blocks; paddles report themselves, as robots do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marl_airhockey.contracts.observable import FRAMES, HISTORY
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.rng import RandomStreams, StreamSet
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.types import Array
from marl_airhockey.world.delay import ALL, Delay, Rows

OCCLUSION_SECONDS = 0.1
"""s: mean length of an occlusion."""


class Sensor:
    """Sensor of B worlds, which turns states into sensed states.

    Args:
        scene: who is on the table.
        num_worlds: B.
        physics: says how much delay, noise and occlusion there can be.
        control_dt: s.
    """

    def __init__(
        self, scene: Scene, num_worlds: int, physics: Physics, control_dt: float
    ) -> None:
        names = ("observation_delay", "position_noise", "occlusion")
        self.ideal = not any(physics.highest(name) for name in names)
        self.control_dt = control_dt
        self.camera = slice(scene.bodies.paddles, scene.bodies.movers)
        """Bodies that the camera sees."""
        self.pucks = scene.bodies.pucks
        things = (num_worlds, self.camera.stop - self.camera.start, 2)
        self.delay = Delay(physics.highest("observation_delay"), control_dt, things)
        self._position, self._speed = np.zeros(things), np.zeros(things)
        self._visible = np.ones((num_worlds, self.pucks), np.bool_)
        self.history = np.zeros((num_worlds, HISTORY, self.pucks, 3))
        """(B, HISTORY, pucks, 3) sensed x, y and visibility, newest last."""
        self.frames = np.zeros((num_worlds, FRAMES, len(scene.bodies), 2))
        """(B, FRAMES, N, 2) sensed positions of all bodies, newest last."""
        self.keeps_history = False
        """True if `history` and `frames` are kept, as an observation needs them."""

    def reset(
        self, worlds: Array, state: State, values: dict[str, Array], streams: StreamSet
    ) -> State:
        """Begin an episode in some worlds and return its first sensed state.

        The past is that of bodies that have moved at their velocities.

        Args:
            worlds: (W,) their indices.
            state: of all B worlds.
            values: physical parameters, (B,) each.
            streams: those of the worlds, for "sensor" too.
        """
        if not self.ideal:
            position = state.position[worlds, self.camera]
            velocity = state.velocity[worlds, self.camera]
            ago = np.arange(self.delay.depth, 0, -1)[:, None, None] * self.control_dt
            self.delay.fill(worlds, position[:, None] - velocity[:, None] * ago)
            late = values["observation_delay"][worlds] + self.control_dt
            self._position[worlds] = position - velocity * late[:, None, None]
            self._visible[worlds] = True
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
        sensed = state
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
        if self.keeps_history:
            newest = np.concatenate([sensed.puck, sensed.visible[..., None]], -1)
            for kept, new in ((self.history, newest), (self.frames, sensed.position)):
                past = kept[rows]
                kept[rows] = np.concatenate([past[:, 1:], new[rows][:, None]], 1)
        return sensed

    def _look(
        self, state: State, values: dict[str, Array], rng: RandomStreams, rows: Rows
    ) -> None:
        """Update the sensed positions and speeds of the bodies in some worlds."""
        true = state.position[rows, self.camera]
        position = self.delay.push(true, values["observation_delay"][rows], rows)
        noise = values["position_noise"][rows][:, None, None]
        position += noise * rng.normal(*position.shape[1:])
        last = self._position[rows]
        visible = self._unhidden(values["occlusion"][rows], rng, rows)
        held = ~visible[..., None]
        np.copyto(position[:, : self.pucks], last[:, : self.pucks], where=held)
        self._speed[rows] = (position - last) / self.control_dt
        self._position[rows] = position
        self._visible[rows] = visible

    def _unhidden(self, share: Array, rng: RandomStreams, rows: Rows) -> Array:
        """Draw occlusions as a two-state Markov chain with the wanted share of time."""
        end = min(self.control_dt / OCCLUSION_SECONDS, 1.0)
        begin = (end * share / (1 - share))[:, None]
        luck = rng.uniform(0.0, 1.0, self.pucks)
        return np.where(self._visible[rows], luck >= begin, luck < end)
