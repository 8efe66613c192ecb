"""Numba backend: the 2D table, one world or thousands, in one compiled loop."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from marl_airhockey.backends._planar.walls import sides
from marl_airhockey.backends.numba.arrays import (
    COEFFICIENTS,
    Static,
    make_coefficients,
)
from marl_airhockey.backends.numba.contacts import find_leaning
from marl_airhockey.backends.numba.kernel import advance
from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import RESULTS, State
from marl_airhockey.core.table import GRAVITY
from marl_airhockey.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array


class NumbaBackend(Backend):
    """Backend with B worlds as rows of arrays, stepped by compiled `kernel.advance`."""

    exact: ClassVar[bool] = True
    default_substeps: ClassVar[int] = 10

    def __init__(
        self, scene: Scene, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        bodies, b = scene.bodies, num_worlds
        lines = [(line.side, line.width is None) for line in scene.goal_lines]
        obstacles = [(*o.start, *(o.end or o.start), o.radius) for o in scene.obstacles]
        self._static = Static(
            bodies.paddles,
            bodies.pucks,
            bodies.blocks,
            np.array(bodies.radius),
            sides(scene),
            np.array(lines, np.int64).reshape(-1, 2),
            np.array(obstacles, np.float64).reshape(-1, 5),
            control_dt,
            substeps,
        )
        seats, table_sides = (b, bodies.paddles), len(scene.table.vertices)
        self._coefficients = np.zeros((b, COEFFICIENTS))
        self._goal = np.zeros((*seats, 2))
        self._imposed = np.zeros(seats, np.bool_)
        self._lifted = np.zeros(seats, np.bool_)
        self._push = np.zeros((b, bodies.movers, 2))
        self._against = np.zeros((b, bodies.pucks, table_sides), np.bool_)
        self._out = np.zeros((b, bodies.pucks), np.bool_)
        self._pathless = np.zeros((b, 0, bodies.movers, 4))

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if scene.blocks and scene.block_shape != "disc":
            return 'square blocks are played by backend "pymunk"'
        if scene.blocks and any(line.width for line in scene.goal_lines):
            return "blocks could slide into a goal; leave out one or the other"
        return None

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        rows = {name: value[worlds] for name, value in values.items()}
        rows["pull"] = GRAVITY * np.sin(np.radians(rows["tilt"]))
        made = make_coefficients(rows, self.control_dt, self.substeps)
        self._coefficients[worlds] = made

    def reset(self, state: State, worlds: Array) -> None:
        super().reset(state, worlds)
        self._push[worlds] = 0.0
        self._out[worlds] = False
        radius = self.scene.table.puck_radius
        find_leaning(worlds, state.puck, radius, self._static.lines, self._against)

    def empty_state(self) -> State:
        # Discs have no spin here: their angles stay, and states share them.
        rest = self._rest
        return replace(super().empty_state(), angle=rest.angle, spin=rest.spin)

    def stage(self, command: Command, before: State, after: State) -> Stage:
        static = [Fixed(x) if isinstance(x, np.ndarray) else x for x in self._static]
        given = ("position", "velocity", "touching", "time")
        filled = [name for name in RESULTS if name not in ("angle", "spin")]
        arguments = (
            *(*static, self._coefficients, *command),
            *(self._goal, self._imposed, self._lifted),
            *(getattr(before, name) for name in given),
            *(getattr(after, name) for name in filled),
            self._pathless if after.path is None else after.path,
            *(self._push, self._against, self._out),
        )
        return Stage(advance, arguments)


make = NumbaBackend
