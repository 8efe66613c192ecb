"""Numba backend: the 2D table in one compiled loop, for one world or thousands."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from marl_airhockey.sim.backends.numba.arrays import (
    Static,
    make_coefficients,
    make_walls,
)
from marl_airhockey.sim.backends.numba.geometry import begin_pucks
from marl_airhockey.sim.backends.numba.kernel import advance, work_space
from marl_airhockey.sim.contracts.backend import Backend, Command
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import RESULTS, State
from marl_airhockey.sim.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array


class NumbaBackend(Backend):
    """Backend with B worlds as rows of arrays, which `kernel.advance` steps."""

    timestep: ClassVar[float | None] = None

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        control_dt: float,
        substeps: int | None = None,
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        bodies, b = scene.bodies, num_worlds
        obstacles = [(*o.start, *(o.end or o.start), o.radius) for o in scene.obstacles]
        self._static = Static(
            *(bodies.paddles, bodies.pucks, bodies.blocks, np.array(bodies.radius)),
            *make_walls(scene),
            np.array(obstacles, np.float64).reshape(-1, 5),
            control_dt,
        )
        seats, pucks = (b, bodies.paddles), (b, bodies.pucks)
        defaults = {name: np.full(b, p.default) for name, p in PARAMETERS.items()}
        self._coefficients = make_coefficients(defaults, control_dt)
        self._goal = np.zeros((*seats, 2))
        self._imposed = np.zeros(seats, np.bool_)
        self._raised = np.zeros(seats, np.bool_)
        self._against = np.zeros((*pucks, len(scene.table.vertices)), np.bool_)
        self._out = np.zeros(pucks, np.bool_)
        self._pinned = np.zeros(pucks)
        self._keys, self._collisions = np.zeros(b, np.uint64), np.zeros(b, np.int64)
        self._work = work_space(self._static, b)
        self._pathless = np.zeros((b, 0, bodies.movers, 4))

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_work": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._work = work_space(self._static, self.num_worlds)

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if scene.blocks and scene.block_shape != "disc":
            return 'square blocks are not supported; use the backend "pymunk"'
        if scene.blocks and any(line.width for line in scene.goal_lines):
            return "blocks could slide into a goal; remove the blocks or the goals"
        return None

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        rows = {name: value[worlds] for name, value in values.items()}
        self._coefficients[worlds] = make_coefficients(rows, self.control_dt)

    def key_scatter(self, keys: Array, worlds: Array) -> None:
        self._keys[worlds], self._collisions[worlds] = keys[worlds], 0

    def reset(self, state: State, worlds: Array) -> None:
        super().reset(state, worlds)
        static, radius = self._static, self.scene.table.puck_radius
        begin_pucks(
            *(worlds, state.puck, radius, static.walls, static.wall_side),
            *(self._against, self._out, self._pinned),
        )

    def serve_stage(self, state: State) -> Stage:
        """Return a stage that puts the pucks of a state into play, by reference."""
        static, radius = self._static, self.scene.table.puck_radius
        walls = Fixed(static.walls), Fixed(static.wall_side)
        arguments = Fixed(np.arange(self.num_worlds)), state.puck, radius, *walls
        filled = self._against, self._out, self._pinned
        return Stage(begin_pucks, (*arguments, *filled))

    def stage(self, command: Command, before: State, after: State) -> Stage:
        static = [Fixed(x) if isinstance(x, np.ndarray) else x for x in self._static]
        given = ("position", "velocity", "angle", "spin", "touching", "time")
        arguments = (
            *(*static, self._coefficients, *command),
            *(self._goal, self._imposed, self._raised),
            *(getattr(before, name) for name in given),
            *(getattr(after, name) for name in RESULTS),
            self._pathless if after.path is None else after.path,
            *(self._against, self._out, self._pinned),
            *(self._keys, self._collisions, *self._work),
        )
        return Stage(advance, arguments)


make = NumbaBackend
