"""Simulation: one world with arms, with a MuJoCo model and data of its own."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.sim.backends.robosuite.arrays import (
    StaticScene,
    make_output,
    make_views,
)
from marl_airhockey.sim.backends.robosuite.inverse_kinematics import find_joint_angles
from marl_airhockey.sim.backends.robosuite.osc import Gains
from marl_airhockey.sim.backends.robosuite.reference import limit_lead, reference_motion
from marl_airhockey.sim.backends.robosuite.stepper import refresh
from marl_airhockey.sim.backends.robosuite.table_physics import TablePhysics
from marl_airhockey.sim.core.state import EVENTS, State
from marl_airhockey.types import Array

SAVED = mujoco.mjtState.mjSTATE_INTEGRATION
"""Part of MuJoCo's state that determines the next step."""


class Simulation:
    """MuJoCo simulation of robosuite's model: one world.

    Args:
        env: Robosuite environment of the model.
        model: Copy of the model for this world.
        path: Shape of the path in the output.
        trace: Trace (substeps, seats, len(TRACE)), filled in every step.
        data: Data of the environment with the initial positions.
    """

    def __init__(
        self, env: Any, model: Any, path: tuple[int, ...], trace: Array, data: Any
    ) -> None:
        self._env, self.model, self.data = env, model, mujoco.MjData(model)
        scene = env.scene
        self.data.qpos[:] = data.qpos
        self.table_physics = TablePhysics(scene, env.frame, model, self.data)
        self._seats, self._pucks = len(scene.seats), scene.pucks
        robots = env.robots
        self._joints = [np.array(r._ref_joint_pos_indexes) for r in robots]
        self._dofs = [np.array(r._ref_joint_vel_indexes) for r in robots]
        self._sites = [int(r.eef_site_id["right"]) for r in robots]
        self.views = make_views(
            model, self.data, self._arm_indices(), self.table_physics, env.hands
        )
        self.output = make_output(scene, path, trace)
        self._reference = np.zeros((self._seats, 2))
        """Reference positions (seats, 2) at the end of the last step, m."""
        self._whole_side = np.array(
            [m.width is None for m in scene.goal_lines], np.bool_
        )
        self._out = np.zeros(self._pucks, np.bool_)
        """True for pucks out of play (pucks,)."""
        self._physics: dict[str, float] = {}

    def _arm_indices(self) -> Array:
        """Return the indices of each arm (seats, 6), see `SimulationViews`."""
        rows = []
        for i, robot in enumerate(self._env.robots):
            joint, dof, site = self._joints[i][0], self._dofs[i][0], self._sites[i]
            motor = int(robot._ref_arm_joint_actuator_indexes[0])
            sensor = self.model.sensor(f"gripper{i}_right_touch").adr[0]
            body = self.model.site_bodyid[site]
            rows.append((joint, dof, motor, site, body, sensor))
        return np.array(rows, np.int64)

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters of table and arms."""
        self._physics = dict(values)
        self.views.gains[:] = Gains(
            plane=values["arm_stiffness"], force=values["arm_force"]
        ).array
        self.views.payloads[:] = values["arm_payload"]
        # The body of the site has no other mass.
        bodies = self.model.site_bodyid[self._sites]
        self.model.body_mass[bodies] = self.views.payloads
        self.table_physics.set_physics(values)

    def reset(
        self,
        static: StaticScene,
        position: Array,
        velocity: Array,
        angle: Array,
        spin: Array,
    ) -> bool:
        """Place all bodies; return True if arms were moved, which are then at rest.

        Arms do not change if their paddles are already in position, for example when a
        puck is served. Otherwise the previous simulation is cleared completely.

        Args:
            static: Static values of the scene.
            position: Positions (bodies, 2), table frame, m.
            velocity: Velocities (bodies, 2), table frame, m/s.
            angle: Orientations (bodies,), rad.
            spin: Angular velocities (bodies,), rad/s.
        """
        d, seats = self.data, self._seats
        moved = bool((position[:seats] != self.output.paddles[:, :2]).any())
        if moved:
            mujoco.mj_resetData(self.model, d)
        for k, at in enumerate(self.table_physics.qpos_index):
            body, dof = seats + k, self.table_physics.dofs[k]
            d.qpos[at : at + 2], d.qpos[at + 2] = position[body], angle[body]
            d.qvel[dof : dof + 2], d.qvel[dof + 2] = velocity[body], spin[body]
        self.table_physics.forget()
        if moved:
            for i in range(seats):
                self._place_arm(i, position[i])
        if self._out.any():
            for puck in np.flatnonzero(self._out).tolist():
                self.table_physics.enable_contacts(puck, True)
            self._out[:] = False
        refresh(self.views, static, self.output)
        if moved:
            self._reference[:] = self.output.paddles[:, :2]
        return moved

    def _place_arm(self, i: int, position: Array) -> None:
        d, env = self.data, self._env
        joints, dofs = self._joints[i], self._dofs[i]
        d.qpos[joints] = find_joint_angles(
            self.model,
            d,
            self._sites[i],
            joints,
            dofs,
            env.frame.to_world(float(position[0]), float(position[1])),
            env.hands[i].foot_rotation,
            env.robots[i].init_qpos,
        )

    def advance_reference(self, old: Array, new: Array, period: float) -> Array:
        """Advance the references by a step; return their positions at its beginning.

        The references continue from the last step, within `limit_lead`.

        Args:
            old: Velocities at the beginning (seats, 2), table frame, m/s.
            new: Velocities at the end (seats, 2), table frame, m/s.
            period: Length of the step, s.

        Returns:
            Positions (seats, 2), table frame, m.
        """
        start = limit_lead(self._reference, self.output.paddles[:, :2])
        out = np.empty((3, 2))
        for i in range(self._seats):
            reference_motion(start[i], old[i], new[i], period, period, out)
            self._reference[i] = out[0]
        return start

    def park_pucks(self) -> None:
        """Stop pucks that have crossed a goal line until they are re-served."""
        through = (self.output.crossed & ~self._whole_side).any(-1)
        for puck in np.flatnonzero(through).tolist():
            self._out[puck] = True
            self.table_physics.enable_contacts(puck, False)
        for puck in np.flatnonzero(self._out).tolist():
            dof = self.table_physics.dofs[puck]
            self.data.qvel[dof : dof + 3] = 0.0
            self.table_physics.sliding.expected[puck] = np.nan

    def read(self, state: State, row: int) -> None:
        """Fill the row of this world in a state of all worlds."""
        d, seats, output = self.data, self._seats, self.output
        state.position[row, :seats] = output.paddles[:, :2]
        state.velocity[row, :seats] = output.paddles[:, 2:]
        for k, at in enumerate(self.table_physics.qpos_index):
            body, dof = seats + k, self.table_physics.dofs[k]
            state.position[row, body] = d.qpos[at : at + 2]
            state.velocity[row, body] = d.qvel[dof : dof + 2]
            state.angle[row, body] = d.qpos[at + 2]
            state.spin[row, body] = d.qvel[dof + 2]
        for name in EVENTS:
            getattr(state, name)[row] = getattr(output, name)
        if state.path is not None:
            state.path[row] = output.path

    def save(self) -> dict[str, Any]:
        """Return everything that `restore` requires, in new arrays."""
        state = np.zeros(mujoco.mj_stateSize(self.model, SAVED))
        mujoco.mj_getState(self.model, self.data, state, SAVED)
        return {
            "physics": dict(self._physics),
            "state": state,
            "output": [array.copy() for array in self.output],
            "reference": self._reference.copy(),
            "out": self._out.copy(),
            "expected": self.table_physics.sliding.expected.copy(),
            "approach": self.table_physics.sliding.approach.copy(),
        }

    def restore(self, static: StaticScene, saved: dict[str, Any]) -> None:
        """Continue from the saved state of another simulation of the same model."""
        self.set_physics(saved["physics"])
        for puck in np.flatnonzero(saved["out"]).tolist():
            self.table_physics.enable_contacts(puck, False)
        mujoco.mj_setState(self.model, self.data, saved["state"], SAVED)
        refresh(self.views, static, self.output)
        for array, row in zip(self.output, saved["output"], strict=True):
            array[...] = row
        self._reference[:], self._out[:] = saved["reference"], saved["out"]
        sliding = self.table_physics.sliding
        sliding.expected[:], sliding.approach[:] = saved["expected"], saved["approach"]
