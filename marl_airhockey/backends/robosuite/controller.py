"""One arm under the contact law: what it is asked, where it is, what torques follow."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.backends.robosuite.frames import TableFrame
from marl_airhockey.backends.robosuite.osc import Gains, reference, torques
from marl_airhockey.core.limits import INFINITE, Limited, limits_stage
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.types import Array

LEASH = 0.02
"""m by which the reference may be ahead of the paddle."""
HOME = 0.35
"""m from the edge of the side to where a paddle waits."""


class SeatController:
    """The arm of a seat, in one simulation.

    Args:
        scene: who is on the table.
        place: where the table stands.
        seat: which of its seats.
        period: s of a control step.
        gains: of the law.
    """

    def __init__(
        self,
        scene: Scene,
        place: TableFrame,
        seat: int,
        period: float,
        gains: Gains | None = None,
    ) -> None:
        self.seat, self.place, self.period = scene.seats[seat], place, period
        self.gains = (gains or Gains()).array
        self.grip = place.grip(scene, seat)
        normal = scene.table.normals[self.seat.side]
        offset = float(scene.table.offsets[self.seat.side]) - HOME
        self.home = (float(-normal[0] * offset), float(-normal[1] * offset))
        """Where a paddle waits, table frame, m."""
        self._reach = ReachPlanes.of(scene.table, (self.seat,))
        self.start, self.old, self.new = np.zeros((3, 2))
        self._steps = 0
        self._acceleration = np.zeros((1, 1, 2))

    def bind(
        self, model: Any, data: Any, site: int, dofs: Any, low: Array, high: Array
    ) -> None:
        """Work on a simulation: a site of the paddle's foot, the arm's joints."""
        self._model, self._data, self._site = model, data, site
        self._dofs = np.asarray(dofs)
        self._body = int(model.site_bodyid[site])
        self.low, self.high = np.array(low, float), np.array(high, float)
        self._jacobian, self._drift = np.zeros((2, 6, model.nv))
        self._mass = np.zeros((model.nv, model.nv))

    def rest(self) -> None:
        """Hold the paddle where it is."""
        self.start, self.old, self.new = self.position[:2], np.zeros(2), np.zeros(2)
        self._acceleration[:] = 0.0

    @property
    def position(self) -> Array:
        """(3,) of the foot in the table frame, m."""
        away = self._data.site_xpos[self._site] - self.place.origin
        return np.asarray(away @ self.place.rotation)

    @property
    def velocity(self) -> Array:
        """(3,) of the foot in the table frame, m/s."""
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jacSite(self._model, self._data, jacobian, None, self._site)
        return np.asarray((jacobian @ self._data.qvel) @ self.place.rotation)

    def ask(self, action: Array) -> None:
        """Take an action (2,): a share of the top speed, in the ego frame."""
        place = self.position[None, None, :2].copy()
        limited, top = Limited.empty(1, 1), (self.seat.speed, self.seat.acceleration)
        stage = limits_stage(
            np.ascontiguousarray(action[None, None]),
            np.full((1, 1, 4), np.nan),
            (place, self.velocity[None, None, :2].copy(), self._acceleration),
            self._reach,
            (np.full(1, top[0]), np.full(1, top[1])),
            self.period,
            limited,
        )
        if not stage():
            raise ValueError(INFINITE)
        self._acceleration = limited.acceleration
        self.go(limited.velocity[0, 0])

    def go(self, velocity: Array) -> None:
        """Ramp to a velocity (2,), m/s in the table frame, within the next period."""
        out = np.zeros((3, 2))
        reference(self.start, self.old, self.new, self.period, self.period, out)
        self.start = limit_lead(out[0], self.position[:2])
        self.old, self.new, self._steps = self.new, np.array(velocity), 0

    def torques(self) -> Array:
        """(n,) Nm, for the next physics step; the model's positions must be fresh."""
        model, data, dofs = self._model, self._data, self._dofs
        jacobian, drift = self._jacobian, self._drift
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self._site)
        place = data.site_xpos[self._site]
        mujoco.mj_jacDot(model, data, drift[:3], drift[3:], place, self._body)
        mujoco.mj_fullM(model, self._mass, data.qM)
        speeds, out, wanted = data.qvel[dofs], np.empty(len(dofs)), np.empty((3, 2))
        elapsed = self._steps * model.opt.timestep
        reference(self.start, self.old, self.new, self.period, elapsed, wanted)
        torques(
            np.ascontiguousarray(jacobian[:, dofs]),
            drift[:, dofs] @ speeds,
            self._mass[np.ix_(dofs, dofs)],
            data.qfrc_bias[dofs],
            speeds,
            self.position,
            data.site_xmat[self._site].reshape(3, 3),
            self.place.rotation,
            self.grip,
            wanted,
            self.gains,
            self.low,
            self.high,
            out,
        )
        self._steps += 1
        return out


def limit_lead(wanted: Array, position: Array) -> Array:
    """A reference (..., 2) that is at most `LEASH` ahead of the paddle."""
    ahead = wanted - position
    far = np.hypot(ahead[..., 0], ahead[..., 1])[..., None]
    return np.asarray(position + ahead * np.minimum(1.0, LEASH / np.maximum(far, 1e-9)))
