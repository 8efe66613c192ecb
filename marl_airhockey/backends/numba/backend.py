"""The 2D table for thousands of worlds at once: one compiled loop (`kernel`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from marl_airhockey.backends._planar.walls import sides
from marl_airhockey.backends.numba.arrays import LAWS, Ground, laws
from marl_airhockey.backends.numba.kernel import advance
from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import RESULTS, State
from marl_airhockey.core.table import GRAVITY
from marl_airhockey.jit.buffers import BufferPool
from marl_airhockey.jit.pipeline import Fixed, Stage
from marl_airhockey.jit.threads import over_rows, spreads
from marl_airhockey.types import Array


class NumbaBackend(Backend):
    """B worlds as rows of arrays, stepped by numba."""

    exact: ClassVar[bool] = True
    default_substeps: ClassVar[int] = 10

    def __init__(
        self, scene: Scene, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        bodies = scene.bodies
        goal_lines = [
            (goal_line.side, goal_line.width is None) for goal_line in scene.goal_lines
        ]
        obstacles = [(*o.start, *(o.end or o.start), o.radius) for o in scene.obstacles]
        self._ground = Ground(
            bodies.paddles,
            bodies.pucks,
            bodies.blocks,
            np.array(bodies.radius),
            sides(scene),
            np.array(goal_lines, np.int64).reshape(-1, 2),
            np.array(obstacles, np.float64).reshape(-1, 5),
            control_dt,
            substeps,
        )
        self._laws = np.zeros((num_worlds, LAWS))
        self._last = self._rows(self.rest_state)
        results = [getattr(self.rest_state, name) for name in RESULTS]
        self._pool = BufferPool([(array.shape[1:], array.dtype) for array in results])
        self._leaning = np.zeros((num_worlds, bodies.pucks, len(goal_lines)), np.bool_)
        self._out = np.zeros((num_worlds, bodies.pucks), np.bool_)
        self._push = np.zeros((num_worlds, bodies.movers, 2))

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if scene.blocks and scene.block_shape != "disc":
            return 'square blocks are played by backend "pymunk"'
        if scene.blocks and any(goal_line.width for goal_line in scene.goal_lines):
            return "blocks could slide into a goal line; leave out one or the other"
        return None

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        rows = {name: value[worlds] for name, value in values.items()}
        rows["pull"] = GRAVITY * np.sin(np.radians(rows["tilt"]))
        self._laws[worlds] = laws(rows, self.control_dt, self.substeps)

    def start(self, state: State, worlds: Array) -> None:
        self._last = self._rows(state)
        self._leaning[worlds] = False
        self._out[worlds] = False
        self._push[worlds] = 0.0

    @staticmethod
    def _rows(state: State) -> tuple[Array, ...]:
        return state.position, state.velocity, state.touching, state.time

    def step(self, command: Command) -> State:
        results = self._pool.take(self.num_worlds)
        moved: dict[str, Any] = dict(zip(RESULTS, results, strict=True))
        path = np.empty(self._path_shape)
        if self.scene.path:
            moved["path"] = path
        state = self.rest_state.replaced(moved)
        closed = self._open if command.closed is None else command.closed
        orders = (*self._follow(command, self._last[0]), closed)
        arrays = self._arrays(orders, self._last, path, results)
        if spreads(self.num_worlds):

            def work(rows: slice) -> None:
                advance(*self._ground, *[array[rows] for array in arrays])

            over_rows(work, self.num_worlds)
        else:
            advance(*self._ground, *arrays)
        if command.prescribed is not None:
            prescribed = orders[1]
            state.velocity[:, : prescribed.shape[1]][prescribed] = command.prescribed[
                prescribed
            ][:, 2:]
        self._last = self._rows(state)
        return state

    def _arrays(
        self,
        orders: tuple[Array, ...],
        last: tuple[Array, ...],
        path: Array,
        results: Sequence[Array],
    ) -> tuple[Array, ...]:
        """All arrays that `advance` works on, but for those that worlds share."""
        position, velocity, time, *happened = results
        return (
            *(self._laws, *orders, *last),
            *(position, velocity, path, self._push, time),
            *(*happened, self._leaning, self._out),
        )

    def stage(self, goal: Array, before: State, after: State) -> Stage:
        orders = (goal, self._nobody, self._nobody, self._open)
        path = after.path if after.path is not None else np.empty(self._path_shape)
        results = [getattr(after, name) for name in RESULTS]
        arrays = self._arrays(orders, self._rows(before), path, results)
        ground = (Fixed(x) if isinstance(x, np.ndarray) else x for x in self._ground)
        return Stage(advance, (*ground, *arrays))

    def finish(self, goal: Array, after: State) -> None:
        self._last = self._rows(after)


make = NumbaBackend
