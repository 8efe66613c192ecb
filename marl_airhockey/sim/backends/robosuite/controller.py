"""Controller of one arm: computes a reference motion and joint torques from actions."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.backends.robosuite.osc import Gains, torques
from marl_airhockey.sim.backends.robosuite.reference import limit_lead, reference_motion
from marl_airhockey.sim.core.limits import INFINITE, Limited, limits_stage
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.types import Array

HOME_DISTANCE = 0.35
"""Distance of a paddle's home position from the edge of its side, m."""


class SeatController:
    """Controller of a seat's arm in one simulation.

    Args:
        scene: Scene of the seat.
        frame: Frame of the table.
        seat: Index of the seat.
        period: Length of a control step, s.
        gains: Gains of `osc.torques`; None for the defaults.
    """

    def __init__(
        self,
        scene: Scene,
        frame: TableFrame,
        seat: int,
        period: float,
        gains: Gains | None = None,
    ) -> None:
        self.seat, self.frame, self.period = scene.seats[seat], frame, period
        self.gains = (gains or Gains()).array
        self.foot_rotation = frame.foot_rotation(scene, seat)
        """Target rotation from the paddle's foot to the world frame (3, 3)."""
        normal = scene.table.normals[self.seat.side]
        offset = float(scene.table.offsets[self.seat.side])
        offset -= HOME_DISTANCE
        self.home = (float(-normal[0] * offset), float(-normal[1] * offset))
        """Home position of the paddle (2,), table frame, m."""
        self._reach = ReachPlanes.of(scene.table, (self.seat,))
        self.start, self.old, self.new = np.zeros((3, 2))
        self._steps = 0
        self._acceleration = np.zeros((1, 1, 2))

    def bind(
        self, model: Any, data: Any, site: int, dofs: Any, low: Array, high: Array
    ) -> None:
        """Set the model, the data, the site of the foot, and the joints of the arm."""
        self._model, self._data, self._site = model, data, site
        self._dofs = np.asarray(dofs)
        self._body = int(model.site_bodyid[site])
        self.low, self.high = np.array(low, float), np.array(high, float)
        self._jacobian, self._drift = np.zeros((2, 6, model.nv))
        self._mass = np.zeros((model.nv, model.nv))

    def hold(self) -> None:
        """Hold the paddle at its current position."""
        self.start, self.old, self.new = self.position[:2], np.zeros(2), np.zeros(2)
        self._acceleration[:] = 0.0

    @property
    def position(self) -> Array:
        """Position of the foot (3,), table frame, m."""
        offset = self._data.site_xpos[self._site] - self.frame.origin
        return np.asarray(offset @ self.frame.rotation)

    @property
    def velocity(self) -> Array:
        """Velocity of the foot (3,), table frame, m/s."""
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jacSite(self._model, self._data, jacobian, None, self._site)
        return np.asarray((jacobian @ self._data.qvel) @ self.frame.rotation)

    def set_action(self, action: Array) -> None:
        """Set an action (2,): target velocity divided by the top speed, ego frame.

        Raises:
            ValueError: An element is not finite.
        """
        position = self.position[None, None, :2].copy()
        limited, top = Limited.empty(1, 1), (self.seat.speed, self.seat.acceleration)
        stage = limits_stage(
            np.ascontiguousarray(action[None, None]),
            np.full((1, 1, 4), np.nan),
            (position, self.velocity[None, None, :2].copy(), self._acceleration),
            self._reach,
            (np.full(1, top[0]), np.full(1, top[1])),
            self.period,
            limited,
        )
        if not stage():
            raise ValueError(INFINITE)
        self._acceleration = limited.acceleration
        self.ramp_to(limited.velocity[0, 0])

    def ramp_to(self, velocity: Array) -> None:
        """Start a ramp of one period to a velocity (2,), table frame, m/s."""
        out = np.zeros((3, 2))
        reference_motion(self.start, self.old, self.new, self.period, self.period, out)
        self.start = limit_lead(out[0], self.position[:2])
        self.old, self.new, self._steps = self.new, np.array(velocity), 0

    def torques(self) -> Array:
        """Return the joint torques (n,) of the next physics step, Nm.

        The derived arrays of the data must be up to date.
        """
        model, data, dofs = self._model, self._data, self._dofs
        jacobian, drift = self._jacobian, self._drift
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self._site)
        point = data.site_xpos[self._site]
        mujoco.mj_jacDot(model, data, drift[:3], drift[3:], point, self._body)
        mujoco.mj_fullM(model, self._mass, data.qM)
        speeds, out, wanted = data.qvel[dofs], np.empty(len(dofs)), np.empty((3, 2))
        elapsed = self._steps * model.opt.timestep
        reference_motion(self.start, self.old, self.new, self.period, elapsed, wanted)
        torques(
            np.ascontiguousarray(jacobian[:, dofs]),
            drift[:, dofs] @ speeds,
            self._mass[np.ix_(dofs, dofs)],
            data.qfrc_bias[dofs],
            speeds,
            self.position,
            data.site_xmat[self._site].reshape(3, 3),
            self.frame.rotation,
            self.foot_rotation,
            wanted,
            self.gains,
            self.low,
            self.high,
            out,
        )
        self._steps += 1
        return out
