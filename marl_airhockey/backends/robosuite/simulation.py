"""One world of arms: its own model and data, views on them, and how it starts."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.backends.robosuite.controller import limit_lead
from marl_airhockey.backends.robosuite.inverse_kinematics import reach_for
from marl_airhockey.backends.robosuite.osc import Gains, reference
from marl_airhockey.backends.robosuite.stepper import (
    Simulation,
    StaticScene,
    StepOutput,
    fresh,
)
from marl_airhockey.backends.robosuite.table_physics import Surface
from marl_airhockey.core.state import EVENTS, State
from marl_airhockey.types import Array

SAVED = mujoco.mjtState.mjSTATE_INTEGRATION
"""Part of MuJoCo's state that the next step depends on."""


class Arms:
    """A MuJoCo simulation of robosuite's model.

    Args:
        env: the robosuite environment that the model is of.
        model: its own copy of the model.
        path: shape of its path.
        trace: (substeps, seats, len(TRACE)), filled at every step.
        data: of the environment, where all begins.
    """

    def __init__(
        self, env: Any, model: Any, path: tuple[int, ...], trace: Array, data: Any
    ) -> None:
        self._env, self.model, self.data = env, model, mujoco.MjData(model)
        scene, d = env.scene, self.data
        d.qpos[:] = data.qpos
        self.surface = Surface(scene, env.place, model, d)
        self._seats, self._pucks = len(scene.seats), scene.pucks
        robots = env.robots
        self._joints = [np.array(r._ref_joint_pos_indexes) for r in robots]
        self._dofs = [np.array(r._ref_joint_vel_indexes) for r in robots]
        self._sites = [int(r.eef_site_id["right"]) for r in robots]
        arms = []
        for i, robot in enumerate(robots):
            site = self._sites[i]
            motor = int(robot._ref_arm_joint_actuator_indexes[0])
            sensor = model.sensor(f"gripper{i}_right_touch")
            arms.append(
                (
                    self._joints[i][0],
                    self._dofs[i][0],
                    motor,
                    site,
                    model.site_bodyid[site],
                    sensor.adr[0],
                )
            )
        places, dofs = self.surface.places, self.surface.dofs
        self.sim = Simulation(
            model._address,
            d._address,
            d.qM.ctypes.data,
            d.qpos,
            d.qvel,
            d.qfrc_applied,
            d.ctrl,
            d.qfrc_bias,
            d.site_xpos,
            d.site_xmat,
            d.sensordata,
            np.array(arms, np.int64),
            np.stack([places, dofs], 1),
            self.surface.rows,
            model.opt.gravity,
            np.array([hand.gains for hand in env.hands]),
            np.zeros(self._seats),
        )
        pairs, goal_lines = (self._seats, self._pucks), len(scene.goal_lines)
        crossings = self._pucks, goal_lines
        banks = self._pucks, len(scene.table.vertices)
        self.output = StepOutput(
            np.zeros((self._seats, 4)),
            np.zeros(pairs, np.int64),
            np.zeros(pairs),
            np.zeros(pairs, np.bool_),
            np.zeros(banks, np.int64),
            np.zeros(banks, np.bool_),
            np.zeros(crossings, np.bool_),
            np.zeros((*crossings, 2)),
            np.zeros(crossings, np.bool_),
            np.zeros(path),
            trace,
        )
        self._ahead = np.zeros((self._seats, 2))
        self._whole = np.array([m.width is None for m in scene.goal_lines], np.bool_)
        self._out = np.zeros(self._pucks, np.bool_)
        self._physics: dict[str, float] = {}

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters of table and arms."""
        self._physics = dict(values)
        self.sim.gains[:] = Gains(
            plane=values["arm_stiffness"], force=values["arm_force"]
        ).array
        self.sim.loads[:] = values["arm_payload"]
        # The body of the site has no mass of its own.
        self.model.body_mass[self.model.site_bodyid[self._sites]] = self.sim.loads
        self.surface.set_physics(values)

    def reset(
        self, static: StaticScene, position: Array, velocity: Array, angle: Array
    ) -> bool:
        """Place all bodies; whether arms were moved, which are at rest then.

        Arms stay as they are if their paddles are to be where they are, which is so
        when a puck is served. Else nothing is left of what was before.
        """
        d, seats = self.data, self._seats
        moved = bool((position[:seats] != self.output.paddles[:, :2]).any())
        if moved:
            mujoco.mj_resetData(self.model, d)
        for k, place in enumerate(self.surface.places):
            body, dof = seats + k, self.surface.dofs[k]
            d.qpos[place : place + 2], d.qpos[place + 2] = position[body], angle[body]
            d.qvel[dof : dof + 2], d.qvel[dof + 2] = velocity[body], 0.0
        if moved:
            for i in range(seats):
                self._reach(i, position[i])
        if self._out.any():
            for puck in np.flatnonzero(self._out).tolist():
                self.surface.put_out(puck, False)
            self._out[:] = False
        fresh(self.sim, static, self.output)
        if moved:
            self._ahead[:] = self.output.paddles[:, :2]
        return moved

    def _reach(self, i: int, place: Array) -> None:
        d, env = self.data, self._env
        joints, dofs = self._joints[i], self._dofs[i]
        d.qpos[joints] = reach_for(
            self.model,
            d,
            self._sites[i],
            joints,
            dofs,
            env.place.to_world(float(place[0]), float(place[1])),
            env.hands[i].grip,
            env.robots[i].init_qpos,
        )

    def lead(self, old: Array, new: Array, period: float) -> Array:
        """(seats, 2) where the references of a step begin; they go on from the last."""
        start = limit_lead(self._ahead, self.output.paddles[:, :2])
        out = np.empty((3, 2))
        for i in range(self._seats):
            reference(start[i], old[i], new[i], period, period, out)
            self._ahead[i] = out[0]
        return start

    def retire(self) -> None:
        """Pucks that are through a goal line lie still until they are served."""
        through = (self.output.crossed & ~self._whole).any(-1)
        for puck in np.flatnonzero(through).tolist():
            self._out[puck] = True
            self.surface.put_out(puck, True)
        for puck in np.flatnonzero(self._out).tolist():
            dof = self.surface.dofs[puck]
            self.data.qvel[dof : dof + 3] = 0.0

    def read(self, state: State, row: int) -> None:
        """Fill a row of a state of all worlds."""
        d, seats, output = self.data, self._seats, self.output
        state.position[row, :seats] = output.paddles[:, :2]
        state.velocity[row, :seats] = output.paddles[:, 2:]
        for k, place in enumerate(self.surface.places):
            body, dof = seats + k, self.surface.dofs[k]
            state.position[row, body] = d.qpos[place : place + 2]
            state.velocity[row, body] = d.qvel[dof : dof + 2]
            state.angle[row, body] = d.qpos[place + 2]
            state.spin[row, body] = d.qvel[dof + 2]
        for name in EVENTS:
            getattr(state, name)[row] = getattr(output, name)
        if state.path is not None:
            state.path[row] = output.path

    def saved(self) -> dict[str, Any]:
        """Return all that a twin needs to go on from here, in arrays."""
        state = np.zeros(mujoco.mj_stateSize(self.model, SAVED))
        mujoco.mj_getState(self.model, self.data, state, SAVED)
        return {
            "physics": dict(self._physics),
            "state": state,
            "output": [array.copy() for array in self.output],
            "ahead": self._ahead.copy(),
            "out": self._out.copy(),
        }

    def restore(self, static: StaticScene, saved: dict[str, Any]) -> None:
        """Go on from where another simulation of the same model was saved."""
        self.set_physics(saved["physics"])
        for puck in np.flatnonzero(saved["out"]).tolist():
            self.surface.put_out(puck, True)
        mujoco.mj_setState(self.model, self.data, saved["state"], SAVED)
        fresh(self.sim, static, self.output)
        for array, row in zip(self.output, saved["output"], strict=True):
            array[...] = row
        self._ahead[:], self._out[:] = saved["ahead"], saved["out"]
