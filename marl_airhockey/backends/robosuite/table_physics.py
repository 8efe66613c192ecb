"""What the table does to what slides on it: gravity, drag, friction, returned speed."""

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


class Surface:
    """Pucks and blocks in one MuJoCo model.

    Args:
        scene: who is on the table.
        place: where it stands.
        model: MuJoCo's model.
        data: its data.
    """

    def __init__(self, scene: Scene, place: TableFrame, model: Any, data: Any) -> None:
        self.scene, self.place, self._model, self._data = scene, place, model, data
        names = [f"puck{k}" for k in range(scene.pucks)]
        names += [f"block{k}" for k in range(scene.blocks)]
        joints = [model.joint(f"{name}_x") for name in names]
        self.places = np.array([j.qposadr[0] for j in joints], np.int64)
        """(movers,) of x in qpos; y and the angle follow."""
        self.dofs = np.array([j.dofadr[0] for j in joints], np.int64)
        self._bodies = [model.body(name).id for name in names]
        self._sides = [model.geom(name).id for name in names]
        felt = [model.geom(k).name for k in range(model.ngeom)]
        self._paddles = [k for k, name in enumerate(felt) if name.endswith("_side")]
        self._feet = [k for k, name in enumerate(felt) if name.endswith("_foot")]
        self._walls = [
            k
            for k, name in enumerate(felt)
            if name.startswith(("rail", "obstacle")) and not name.endswith("visual")
        ]
        for k in (*self._paddles, *self._feet):
            model.geom_size[k, 0] = scene.table.paddle_radius
        self.rows = np.zeros((len(names), 3))
        """(movers, 3) mass kg, Coulomb friction m/s2, pull along x m/s2"""
        defaults = {name: p.default for name, p in PARAMETERS.items()}
        self.set_physics({**defaults, **scene.defaults})

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters that a table has."""
        model, pucks = self._model, self.scene.pucks
        model.opt.gravity[:] = self.place.gravity(values["tilt"], GRAVITY)
        dt = model.opt.timestep
        for geoms, name in (
            (self._walls, "wall_restitution"),
            (self._paddles, "paddle_restitution"),
            (self._sides[pucks:], "block_restitution"),
        ):
            model.geom_solref[geoms] = solref(values[name], dt)
        model.geom_solref[self._sides[:pucks]] = solref(1.0, dt)
        self.rows[:pucks, 0] = values["puck_mass"]
        self.rows[pucks:, 0] = values["block_mass"]
        self.rows[pucks:, 1] = values["block_friction"]
        self.rows[:, 2] = -GRAVITY * np.sin(np.radians(values["tilt"]))
        for body, dof, mass in zip(
            self._bodies, self.dofs, self.rows[:, 0], strict=True
        ):
            model.body_inertia[body] *= mass / model.body_mass[body]
            model.body_mass[body] = mass
            model.dof_damping[dof : dof + 2] = values["puck_damping"] * mass
            model.dof_damping[dof + 2] = 1e-7
        # Contacts are scaled by inverse masses that are kept beside the masses.
        kept = self._data.qpos.copy(), self._data.qvel.copy()
        mujoco.mj_setConst(model, self._data)
        self._data.qpos[:], self._data.qvel[:] = kept

    def act(self) -> None:
        """Before a physics step: friction and the cap on speed."""
        data, dt = self._data, self._model.opt.timestep
        slide(self.rows, self.dofs, self.scene.pucks, data.qvel, data.qfrc_applied, dt)

    def put_out(self, puck: int, out: bool) -> None:
        """Take a puck off the table, or put it back on: it touches nothing then."""
        bits = 0 if out else SLIDES | RAIL
        side = self._sides[puck]
        self._model.geom_contype[side] = self._model.geom_conaffinity[side] = bits


@njit(cache=True)
def slide(
    rows: Array, dofs: Array, pucks: int, speeds: Array, forces: Array, dt: float
) -> None:
    """Coulomb friction of blocks, as a force; the cap on the speed of pucks.

    Args:
        rows: (movers, 3) of `Surface`.
        dofs: (movers,) of x in ``speeds``.
        pucks: how many of the movers are pucks; they come first.
        speeds: (nv,) m/s, changed where a puck is too fast.
        forces: (nv,) N, filled for blocks.
        dt: s of a physics step.
    """
    for i in range(len(dofs)):
        k = dofs[i]
        if i < pucks:
            size = np.hypot(speeds[k], speeds[k + 1])
            if size > PUCK_SPEED_CAP:
                speeds[k] *= PUCK_SPEED_CAP / size
                speeds[k + 1] *= PUCK_SPEED_CAP / size
            continue
        # What it would have without friction; friction takes no more than that.
        vx, vy = speeds[k] + rows[i, 2] * dt, speeds[k + 1]
        size = np.hypot(vx, vy)
        if size > 0.0:
            push = -rows[i, 0] * min(rows[i, 1], size / dt) / size
            forces[k], forces[k + 1] = push * vx, push * vy
