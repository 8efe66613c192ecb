"""Table physics in MuJoCo: gravity, drag, friction, restitution of sliding bodies."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numba import njit

from marl_airhockey.backends.robosuite.frames import TableFrame
from marl_airhockey.backends.robosuite.models import RAIL, SLIDES
from marl_airhockey.backends.robosuite.restitution import solref
from marl_airhockey.core.physics import PARAMETERS, PUCK_SPEED_CAP
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.table import GRAVITY
from marl_airhockey.types import Array

ABSENT = ("wall_restitution_slope", "wall_friction", "paddle_friction", "puck_friction")
"""Parameters of laws that contacts here do not have."""


class TablePhysics:
    """Physics of the pucks and blocks in one MuJoCo model.

    Args:
        scene: scene of the model.
        frame: frame of the table.
        model: MuJoCo's model.
        data: its data.
    """

    def __init__(self, scene: Scene, frame: TableFrame, model: Any, data: Any) -> None:
        self.scene, self.frame, self._model, self._data = scene, frame, model, data
        names = [f"puck{k}" for k in range(scene.pucks)]
        names += [f"block{k}" for k in range(scene.blocks)]
        joints = [model.joint(f"{name}_x") for name in names]
        self.qpos_index = np.array([j.qposadr[0] for j in joints], np.int64)
        """Indices of x in qpos (movers,); y and the angle follow."""
        self.dofs = np.array([j.dofadr[0] for j in joints], np.int64)
        """Indices of x in qvel (movers,); y and the angle follow."""
        self._bodies = [model.body(name).id for name in names]
        self._sides = [model.geom(name).id for name in names]
        geoms = [model.geom(k).name for k in range(model.ngeom)]
        self._paddles = [k for k, name in enumerate(geoms) if name.endswith("_side")]
        self._feet = [k for k, name in enumerate(geoms) if name.endswith("_foot")]
        self._walls = [
            k
            for k, name in enumerate(geoms)
            if name.startswith(("rail", "obstacle")) and not name.endswith("visual")
        ]
        for k in (*self._paddles, *self._feet):
            model.geom_size[k, 0] = scene.table.paddle_radius
        self.coefficients = np.zeros((len(names), 5))
        """Mass (kg), Coulomb friction (m/s2), pull along x and y (m/s2) and quadratic
        drag (1/m) (movers, 5)."""
        defaults = {name: p.default for name, p in PARAMETERS.items()}
        self.set_physics({**defaults, **scene.defaults})

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters of the table.

        Raises:
            ValueError: friction or a restitution that depends on speed.
        """
        for name in ABSENT:
            if values[name] != 0.0:
                raise ValueError(
                    f"physics[{name!r}]: contacts of backend 'robosuite' have no "
                    "friction, and a restitution of their own at every speed; set it "
                    "to 0 there, or take the preset 'frictionless'"
                )
        model, pucks = self._model, self.scene.pucks
        model.opt.gravity[:] = self.frame.gravity(
            values["tilt"], values["cross_tilt"], GRAVITY
        )
        dt = model.opt.timestep
        for geoms, name in (
            (self._walls, "wall_restitution"),
            (self._paddles, "paddle_restitution"),
            (self._sides[pucks:], "block_restitution"),
        ):
            model.geom_solref[geoms] = solref(values[name], dt)
        model.geom_solref[self._sides[:pucks]] = solref(values["puck_restitution"], dt)
        coefficients = self.coefficients
        coefficients[:pucks, 0] = values["puck_mass"]
        coefficients[pucks:, 0] = values["block_mass"]
        coefficients[pucks:, 1] = values["block_friction"]
        coefficients[:, 2] = -GRAVITY * np.sin(np.radians(values["tilt"]))
        coefficients[:, 3] = -GRAVITY * np.sin(np.radians(values["cross_tilt"]))
        coefficients[:pucks, 4] = values["puck_drag"]
        for body, dof, mass in zip(
            self._bodies, self.dofs, coefficients[:, 0], strict=True
        ):
            model.body_inertia[body] *= mass / model.body_mass[body]
            model.body_mass[body] = mass
            model.dof_damping[dof : dof + 2] = values["puck_damping"] * mass
            model.dof_damping[dof + 2] = 1e-7
        # Contacts are scaled by inverse masses, which `mj_setConst` derives anew.
        kept = self._data.qpos.copy(), self._data.qvel.copy()
        mujoco.mj_setConst(model, self._data)
        self._data.qpos[:], self._data.qvel[:] = kept

    def apply_friction(self) -> None:
        """Apply friction and the cap on speed, before a physics step."""
        data, dt = self._data, self._model.opt.timestep
        speeds, forces = data.qvel, data.qfrc_applied
        apply_friction(
            self.coefficients, self.dofs, self.scene.pucks, speeds, forces, dt
        )

    def enable_contacts(self, puck: int, enabled: bool) -> None:
        """Enable the contacts of a puck, or disable them while it is out of play."""
        bits = SLIDES | RAIL if enabled else 0
        side = self._sides[puck]
        self._model.geom_contype[side] = self._model.geom_conaffinity[side] = bits


@njit(cache=True)
def apply_friction(
    coefficients: Array,
    dofs: Array,
    pucks: int,
    speeds: Array,
    forces: Array,
    dt: float,
) -> None:
    """Apply drag to pucks and friction to blocks, and cap the speed of pucks.

    Args:
        coefficients: (movers, 5) of `TablePhysics`.
        dofs: indices of x in ``speeds`` (movers,).
        pucks: number of pucks, which are the first movers.
        speeds: (nv,) m/s, changed where a puck is too fast.
        forces: (nv,) N, filled for pucks and blocks.
        dt: length of a physics step, s.
    """
    for i in range(len(dofs)):
        k = dofs[i]
        if i < pucks:
            size = np.hypot(speeds[k], speeds[k + 1])
            if size > PUCK_SPEED_CAP:
                speeds[k] *= PUCK_SPEED_CAP / size
                speeds[k + 1] *= PUCK_SPEED_CAP / size
            push = -coefficients[i, 0] * coefficients[i, 4] * size
            forces[k], forces[k + 1] = push * speeds[k], push * speeds[k + 1]
            continue
        # Velocity without friction, which removes at most all of it.
        vx = speeds[k] + coefficients[i, 2] * dt
        vy = speeds[k + 1] + coefficients[i, 3] * dt
        size = np.hypot(vx, vy)
        if size > 0.0:
            push = -coefficients[i, 0] * min(coefficients[i, 1], size / dt) / size
            forces[k], forces[k + 1] = push * vx, push * vy
