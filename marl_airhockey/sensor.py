"""What is sensed of a state: delayed, noisy, held while unseen, and its history.

A camera sees pucks and blocks; paddles report themselves, as robots do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marl_airhockey.cast import Cast
from marl_airhockey.draws import Draws
from marl_airhockey.layout import FRAMES, HISTORY
from marl_airhockey.physics import Physics
from marl_airhockey.state import Array, State

OCCLUSION_SECONDS = 0.1
"""s: mean length of an occlusion."""


Rows = Array | slice
"""Some of the worlds: indices (W,), or all of them."""
ALL = slice(None)


class Delay:
    """Values as they were some time ago, interpolated between control steps.

    Args:
        longest: the largest delay, s.
        control_dt: s between two values.
        shape: (B, ...) of a value.
    """

    def __init__(
        self, longest: float, control_dt: float, shape: tuple[int, ...]
    ) -> None:
        self.control_dt = control_dt
        self.depth = int(np.ceil(longest / control_dt - 1e-9)) + 1
        self._past = np.zeros((shape[0], self.depth, *shape[1:]))

    def fill(self, rows: Rows, past: Array) -> None:
        """Begin anew in some worlds with what came before, (W, depth, ...)."""
        self._past[rows] = past

    def push(self, value: Array, delay: Array, rows: Rows = ALL) -> Array:
        """Take the newest value (W, ...) and give that of ``delay`` (W,) s ago."""
        past = np.concatenate([self._past[rows][:, 1:], value[:, None]], axis=1)
        self._past[rows] = past
        back = delay / self.control_dt
        whole = np.floor(back).astype(np.int64)
        share = (back - whole).reshape(-1, *(1,) * (value.ndim - 1))
        worlds, last = np.arange(len(value)), self.depth - 1
        newer = past[worlds, np.maximum(last - whole, 0)]
        older = past[worlds, np.maximum(last - whole - 1, 0)]
        return np.asarray((1 - share) * newer + share * older)


class Sensor:
    """Turns states of B worlds into sensed states.

    Args:
        cast: who is on the table.
        num_worlds: B.
        physics: says how much delay, noise and occlusion there can be.
        control_dt: s.
    """

    def __init__(
        self, cast: Cast, num_worlds: int, physics: Physics, control_dt: float
    ) -> None:
        names = ("observation_delay", "position_noise", "occlusion")
        self.ideal = not any(physics.highest(name) for name in names)
        self.control_dt = control_dt
        self.camera = slice(cast.bodies.paddles, cast.bodies.movers)
        """The bodies that the camera sees."""
        self.pucks = cast.bodies.pucks
        things = (num_worlds, self.camera.stop - self.camera.start, 2)
        self.delay = Delay(physics.highest("observation_delay"), control_dt, things)
        self._place, self._speed = np.zeros(things), np.zeros(things)
        self._visible = np.ones((num_worlds, self.pucks), np.bool_)
        self.history = np.zeros((num_worlds, HISTORY, self.pucks, 3))
        """(B, HISTORY, pucks, 3) sensed x, y and visibility, newest last."""
        self.frames = np.zeros((num_worlds, FRAMES, len(cast.bodies), 2))
        """(B, FRAMES, N, 2) sensed positions of all bodies, newest last."""
        self.keeps_history = False
        """Whether `history` and `frames` are kept: only if anybody looks at them."""

    def start(
        self, worlds: Array, state: State, values: dict[str, Array], draws: Draws
    ) -> State:
        """Begin an episode in some worlds and sense its first state.

        Args:
            worlds: (W,) their indices.
            state: of all B worlds.
            values: physical parameters, (B,) each.
            draws: the sensor's streams.
        """
        if not self.ideal:
            position, velocity = (x[worlds, self.camera] for x in _motion(state))
            ago = np.arange(self.delay.depth, 0, -1)[:, None, None] * self.control_dt
            self.delay.fill(worlds, position[:, None] - velocity[:, None] * ago)
            late = values["observation_delay"][worlds] + self.control_dt
            self._place[worlds] = position - velocity * late[:, None, None]
            self._visible[worlds] = True
        sensed = self.sense(state, values, draws, worlds)
        if self.keeps_history:
            self.history[worlds] = self.history[worlds][:, -1:]
            self.frames[worlds] = self.frames[worlds][:, -1:]
        return sensed

    def sense(
        self,
        state: State,
        values: dict[str, Array],
        draws: Draws,
        rows: Rows = ALL,
    ) -> State:
        """The sensed state; ``rows`` tells in which worlds time has gone on."""
        if self.ideal and not self.keeps_history:
            return state
        sensed = state
        if not self.ideal:
            self._look(state, values, draws.select(rows), rows)
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
        self, state: State, values: dict[str, Array], draws: Draws, rows: Rows
    ) -> None:
        """Update what the camera makes of the bodies in some worlds."""
        true = state.position[rows, self.camera]
        place = self.delay.push(true, values["observation_delay"][rows], rows)
        noise = values["position_noise"][rows][:, None, None]
        place += noise * draws.normal(*place.shape[1:])
        last = self._place[rows]
        visible = self._unhidden(values["occlusion"][rows], draws, rows)
        held = ~visible[..., None]
        np.copyto(place[:, : self.pucks], last[:, : self.pucks], where=held)
        self._speed[rows] = (place - last) / self.control_dt
        self._place[rows] = place
        self._visible[rows] = visible

    def _unhidden(self, share: Array, draws: Draws, rows: Rows) -> Array:
        """Occlusions as a two-state Markov chain with the wanted share of time."""
        end = min(self.control_dt / OCCLUSION_SECONDS, 1.0)
        begin = (end * share / (1 - share))[:, None]
        luck = draws.uniform(0.0, 1.0, self.pucks)
        return np.where(self._visible[rows], luck >= begin, luck < end)


def _motion(state: State) -> tuple[Array, Array]:
    return state.position, state.velocity
