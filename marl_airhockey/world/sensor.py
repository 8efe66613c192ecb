"""What is sensed of a state: delayed, noisy, held while unseen, and its history.

A camera sees pucks and blocks; paddles report themselves, as robots do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marl_airhockey.contracts.observable import FRAMES, HISTORY
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.types import Array
from marl_airhockey.world.delay import ALL, Delay, Rows

OCCLUSION_SECONDS = 0.1
"""s: mean length of an occlusion."""


class Sensor:
    """Turns states of B worlds into sensed states.

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
        """The bodies that the camera sees."""
        self.pucks = scene.bodies.pucks
        things = (num_worlds, self.camera.stop - self.camera.start, 2)
        self.delay = Delay(physics.highest("observation_delay"), control_dt, things)
        self._place, self._speed = np.zeros(things), np.zeros(things)
        self._visible = np.ones((num_worlds, self.pucks), np.bool_)
        self.history = np.zeros((num_worlds, HISTORY, self.pucks, 3))
        """(B, HISTORY, pucks, 3) sensed x, y and visibility, newest last."""
        self.frames = np.zeros((num_worlds, FRAMES, len(scene.bodies), 2))
        """(B, FRAMES, N, 2) sensed positions of all bodies, newest last."""
        self.keeps_history = False
        """Whether `history` and `frames` are kept: only if anybody looks at them."""

    def start(
        self, worlds: Array, state: State, values: dict[str, Array], rng: RandomStreams
    ) -> State:
        """Begin an episode in some worlds and sense its first state.

        Args:
            worlds: (W,) their indices.
            state: of all B worlds.
            values: physical parameters, (B,) each.
            rng: the sensor's streams.
        """
        if not self.ideal:
            position, velocity = (x[worlds, self.camera] for x in _motion(state))
            ago = np.arange(self.delay.depth, 0, -1)[:, None, None] * self.control_dt
            self.delay.fill(worlds, position[:, None] - velocity[:, None] * ago)
            late = values["observation_delay"][worlds] + self.control_dt
            self._place[worlds] = position - velocity * late[:, None, None]
            self._visible[worlds] = True
        sensed = self.sense(state, values, rng, worlds)
        if self.keeps_history:
            self.history[worlds] = self.history[worlds][:, -1:]
            self.frames[worlds] = self.frames[worlds][:, -1:]
        return sensed

    def sense(
        self,
        state: State,
        values: dict[str, Array],
        rng: RandomStreams,
        rows: Rows = ALL,
    ) -> State:
        """The sensed state; ``rows`` tells in which worlds time has gone on."""
        if self.ideal and not self.keeps_history:
            return state
        sensed = state
        if not self.ideal:
            self._look(state, values, rng.select(rows), rows)
            position, velocity = (x.copy() for x in _motion(state))
            position[:, self.camera] = self._place
            velocity[:, self.camera] = self._speed
            sensed = replace(
                state,
                position=position,
                velocity=velocity,
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
        """Update what the camera makes of the bodies in some worlds."""
        true = state.position[rows, self.camera]
        place = self.delay.push(true, values["observation_delay"][rows], rows)
        noise = values["position_noise"][rows][:, None, None]
        place += noise * rng.normal(*place.shape[1:])
        last = self._place[rows]
        visible = self._unhidden(values["occlusion"][rows], rng, rows)
        held = ~visible[..., None]
        np.copyto(place[:, : self.pucks], last[:, : self.pucks], where=held)
        self._speed[rows] = (place - last) / self.control_dt
        self._place[rows] = place
        self._visible[rows] = visible

    def _unhidden(self, share: Array, rng: RandomStreams, rows: Rows) -> Array:
        """Occlusions as a two-state Markov chain with the wanted share of time."""
        end = min(self.control_dt / OCCLUSION_SECONDS, 1.0)
        begin = (end * share / (1 - share))[:, None]
        luck = rng.uniform(0.0, 1.0, self.pucks)
        return np.where(self._visible[rows], luck >= begin, luck < end)


def _motion(state: State) -> tuple[Array, Array]:
    return state.position, state.velocity
