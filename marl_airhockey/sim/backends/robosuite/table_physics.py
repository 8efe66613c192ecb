"""Table physics in MuJoCo: gravity, drag, friction and restitution of bodies."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from marl_airhockey.sim.backends._planar.walls import sides
from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.backends.robosuite.models import RAIL, SLIDES
from marl_airhockey.sim.backends.robosuite.restitution import IMPEDANCE, solref
from marl_airhockey.sim.backends.robosuite.sliding import Sliding, apply_laws
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import GRAVITY
from marl_airhockey.types import Array


class TablePhysics:
    """Physics of the pucks and blocks in one MuJoCo model.

    Args:
        scene: Scene of the model.
        frame: Frame of the table.
        model: MuJoCo model.
        data: MuJoCo data.
    """

    def __init__(self, scene: Scene, frame: TableFrame, model: Any, data: Any) -> None:
        self.scene, self.frame, self._model, self._data = scene, frame, model, data
        names = [f"puck{k}" for k in range(scene.pucks)]
        names += [f"block{k}" for k in range(scene.blocks)]
        joints = [model.joint(f"{name}_x") for name in names]
        self.qpos_index = np.array([j.qposadr[0] for j in joints], np.int64)
        """Indices of x in qpos (movers,), before y and the angle."""
        self.dofs = np.array([j.dofadr[0] for j in joints], np.int64)
        """Indices of x in qvel (movers,), before y and the angle."""
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
        # With equal first numbers, the impedance is the same at every depth.
        model.geom_solimp[[*self._walls, *self._paddles, *self._sides], :2] = IMPEDANCE
        rails = [(k, n) for k, n in enumerate(geoms) if n.startswith("rail")]
        rails = [(k, n) for k, n in rails if not n.endswith("visual")]
        lines = sides(scene)
        self.sliding = Sliding(
            place=self.qpos_index,
            dofs=self.dofs,
            radius=np.array(scene.bodies.radius)[len(scene.seats) - 1 :],
            pucks=scene.pucks,
            coefficients=np.zeros((len(names), 6)),
            laws=np.zeros(5),
            sides=lines,
            rails=np.array([k for k, _ in rails], np.int64),
            rail_side=np.array(
                [int(n.removeprefix("rail").split("_")[0]) for _, n in rails], np.int64
            ),
            damping=solref(np.linspace(0.0, 1.0, 101), model.opt.timestep)[:, 1].copy(),
            solref=model.geom_solref,
            expected=np.full((scene.pucks, 2), np.nan),
            approach=np.zeros((scene.pucks, len(lines))),
        )
        defaults = {name: p.default for name, p in PARAMETERS.items()}
        self.set_physics({**defaults, **scene.defaults})

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters of the table."""
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
        laws = (
            *("wall_restitution", "wall_restitution_slope"),
            *("wall_friction", "paddle_friction", "puck_friction"),
        )
        self.sliding.laws[:] = [values[name] for name in laws]
        coefficients = self.sliding.coefficients
        coefficients[:pucks, 0] = values["puck_mass"]
        coefficients[pucks:, 0] = values["block_mass"]
        coefficients[pucks:, 1] = values["block_friction"]
        coefficients[:, 2] = -GRAVITY * np.sin(np.radians(values["tilt"]))
        coefficients[:, 3] = -GRAVITY * np.sin(np.radians(values["cross_tilt"]))
        coefficients[:pucks, 4] = values["puck_drag"]
        coefficients[:, 5] = values["puck_damping"]
        for body, dof, mass in zip(
            self._bodies, self.dofs, coefficients[:, 0], strict=True
        ):
            model.body_inertia[body] *= mass / model.body_mass[body]
            model.body_mass[body] = mass
            model.dof_damping[dof : dof + 2] = values["puck_damping"] * mass
            model.dof_damping[dof + 2] = 0.0
        # Inverse masses scale contacts; `mj_setConst` computes them again.
        kept = self._data.qpos.copy(), self._data.qvel.copy()
        mujoco.mj_setConst(model, self._data)
        self._data.qpos[:], self._data.qvel[:] = kept

    def apply_laws(self, paddles: Array) -> None:
        """Apply drag, friction and restitution to bodies before a physics step.

        Args:
            paddles: Columns x, y, vx, vy of the paddles (seats, 4), table frame.
        """
        data, dt = self._data, self._model.opt.timestep
        motion = data.qpos, data.qvel, data.qfrc_applied
        apply_laws(self.sliding, paddles, *motion, dt)

    def forget(self) -> None:
        """Clear the contacts of the last step after bodies were placed."""
        self.sliding.expected[:], self.sliding.approach[:] = np.nan, 0.0

    def enable_contacts(self, puck: int, enabled: bool) -> None:
        """Enable the contacts of a puck, or disable them while it is out of play."""
        bits = SLIDES | RAIL if enabled else 0
        side = self._sides[puck]
        self._model.geom_contype[side] = self._model.geom_conaffinity[side] = bits
