"""The 2D table on pymunk (Chipmunk): B spaces stepped in a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from marl_airhockey.backends.pymunk.chipmunk import (
    AVAILABLE,
    EVENT,
    SUBSTEP,
    new_flags,
    step_quiet,
)
from marl_airhockey.backends.pymunk.space import Space
from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import EVENTS, RESULTS, State
from marl_airhockey.jit.pipeline import Fixed, NotCompilable, Stage
from marl_airhockey.types import Array


class Pymunk(Backend):
    """B pymunk spaces behind the backend contract."""

    exact: ClassVar[bool] = True
    default_substeps: ClassVar[int] = 10

    def __init__(
        self, scene: Scene, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        self._flags = new_flags(num_worlds)
        self.spaces = [Space(scene, control_dt, substeps, row) for row in self._flags]
        self._worlds = np.array([s.addresses for s in self.spaces], np.int64)
        self.state = self.rest_state
        self._closed = self._open
        self._kicks = np.zeros((num_worlds, len(scene.bodies)))
        self._pathless = np.empty((num_worlds, 0, scene.bodies.movers, 4))
        self._left = np.zeros(1, np.int64)
        self._eventful: list[int] = []
        """Worlds in which something touched or crossed at the end of the last step."""
        self._turns = scene.blocks > 0 and scene.block_shape == "square"

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if scene.blocks and any(goal_line.width for goal_line in scene.goal_lines):
            return "blocks could slide into a goal line; leave out one or the other"
        return None

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        for i in worlds.tolist():
            row = {name: float(value[i]) for name, value in values.items()}
            self.spaces[i].set_physics(row)
            self._kicks[i, self.scene.bodies.puck] = self.spaces[i].kick

    def start(self, state: State, worlds: Array) -> None:
        self.state, rows = state, worlds.tolist()
        for i in rows:
            self.spaces[i].start(state.position[i], state.velocity[i], state.angle[i])
        self._eventful = sorted({*self._eventful, *rows})

    def step(self, command: Command) -> State:
        before, after = self.state, self.empty_state()
        goal, prescribed, lifted = self._follow(command, before.position)
        if command.prescribed is not None:
            self._lift(lifted, True)
        orders = np.ascontiguousarray(goal), prescribed, lifted
        self.begin(command.closed)
        if AVAILABLE:
            step_quiet(*self._arguments(orders, before, after))
        else:
            self._leave_all(before, after)
        self._go_on(orders, after)
        if command.prescribed is not None:
            after.velocity[:, : prescribed.shape[1]][prescribed] = command.prescribed[
                prescribed
            ][:, 2:]
            self._lift(lifted, False)
        if self._turns:
            after = self._with_turns(after)
        self.state = after
        return after

    def stage(self, goal: Array, before: State, after: State) -> Stage:
        if self._turns or not AVAILABLE:
            raise NotCompilable("steps of squares, and on this system, need Python")
        orders = goal, self._nobody, self._nobody
        *arguments, left = self._arguments(orders, before, after)
        return Stage(step_quiet, (*arguments, Fixed(left)))

    def begin(self, closed: Array | None = None) -> None:
        closed = self._open if closed is None else closed
        if closed is not self._closed:
            for i in np.flatnonzero((closed != self._closed).any(-1)).tolist():
                self.spaces[i].closed(closed[i])
            self._closed = closed
        for i in self._eventful:
            self.spaces[i].begin()
        self._eventful = []

    def finish(self, goal: Array, after: State) -> None:
        self._go_on((goal, self._nobody, self._nobody), after)
        self.state = after

    def _arguments(
        self, orders: tuple[Array, Array, Array], before: State, after: State
    ) -> tuple[Any, ...]:
        """What `step_quiet` is called with."""
        path = self._pathless if after.path is None else after.path
        return (
            *(before.position, before.velocity, before.time, self._worlds, *orders),
            *(self._kicks, self.control_dt, self.substeps),
            *(2 * self.scene.table.paddle_radius, self._flags, path),
            *(getattr(after, name) for name in RESULTS),
            self._left,
        )

    def _leave_all(self, before: State, after: State) -> None:
        """All worlds as they were, for Python to step."""
        for name in RESULTS:
            getattr(after, name)[...] = getattr(self.rest_state, name)
        for name in ("position", "velocity"):
            getattr(after, name)[...] = getattr(before, name)
        after.time[...] = before.time + self.control_dt
        self._flags[:, SUBSTEP], self._left[0] = -1, self.num_worlds

    def _go_on(self, orders: tuple[Array, Array, Array], after: State) -> None:
        """Step the worlds that are not quiet to the end, and tell what happened."""
        position, velocity, path = after.position, after.velocity, after.path
        if self._left[0]:
            goal, prescribed, lifted = orders
            for i in np.flatnonzero(self._flags[:, EVENT] | (not AVAILABLE)).tolist():
                own = None if path is None else path[i]
                hands = goal[i], prescribed[i], lifted[i]
                self._finish(i, *hands, position[i], velocity[i], own)
        if path is not None:
            path[..., 2] += self._kicks[:, None, : path.shape[2]]
        for i in self._eventful:
            space = self.spaces[i]
            for name in EVENTS:
                getattr(after, name)[i] = getattr(space, name)
            for k, place in space.out.items():
                puck = self.scene.bodies.puck.start + k
                position[i, puck], velocity[i, puck] = place, 0.0

    def _finish(
        self,
        i: int,
        goal: Array,
        prescribed: Array,
        lifted: Array,
        position: Array,
        velocity: Array,
        path: Array | None,
    ) -> None:
        """Step a world to the end of the control step, in place."""
        space, seats = self.spaces[i], len(goal)
        speeds = velocity[:seats].copy()
        space.step(position[:seats], speeds, goal, prescribed, lifted, path)
        rows = space.read()
        position[: len(rows)], velocity[: len(rows)] = rows[:, :2], rows[:, 2:]
        velocity[: len(rows), 0] += self._kicks[i, : len(rows)]
        velocity[:seats] = speeds
        if self._flags[i, EVENT]:
            self._eventful.append(i)

    def _lift(self, lifted: Array, up: bool) -> None:
        for i, k in zip(*np.nonzero(lifted), strict=True):
            self.spaces[i].lift(int(k), up)

    def _with_turns(self, state: State) -> State:
        angle, spin = np.zeros((2, *state.time.shape, len(state.bodies)))
        first = self.scene.bodies.block.start
        for i, space in enumerate(self.spaces):
            for k, body in enumerate(space.bodies[first:], start=first):
                angle[i, k], spin[i, k] = body.angle, body.angular_velocity
        return replace(state, angle=angle, spin=spin)


make = Pymunk
