"""The 2D table on pymunk (Chipmunk): B spaces stepped in a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from marl_airhockey.backend import Backend, Command
from marl_airhockey.cast import Cast
from marl_airhockey.chain import Fixed, Stage, Unchained
from marl_airhockey.chipmunk import AVAILABLE, EVENT, SUBSTEP, new_flags, step_quiet
from marl_airhockey.space import Space
from marl_airhockey.state import EVENTS, RESULTS, Array, State


class Pymunk(Backend):
    """B pymunk spaces behind the backend contract."""

    exact: ClassVar[bool] = True
    default_substeps: ClassVar[int] = 10

    def __init__(
        self, cast: Cast, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(cast, num_worlds, control_dt, substeps)
        self._flags = new_flags(num_worlds)
        self.spaces = [Space(cast, control_dt, substeps, row) for row in self._flags]
        self._worlds = np.array([s.addresses for s in self.spaces], np.int64)
        self.state = self.quiet
        self._shut = self._open
        self._kicks = np.zeros((num_worlds, len(cast.bodies)))
        self._pathless = np.empty((num_worlds, 0, cast.bodies.movers, 4))
        self._left = np.zeros(1, np.int64)
        self._eventful: list[int] = []
        """Worlds in which something touched or crossed at the end of the last step."""
        self._turns = cast.blocks > 0 and cast.block_shape == "square"

    @classmethod
    def supports(cls, cast: Cast) -> str | None:
        if cast.blocks and any(mouth.width for mouth in cast.mouths):
            return "blocks could slide into a goal mouth; leave out one or the other"
        return None

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        for i in worlds.tolist():
            row = {name: float(value[i]) for name, value in values.items()}
            self.spaces[i].set_physics(row)
            self._kicks[i, self.cast.bodies.puck] = self.spaces[i].kick

    def start(self, state: State, worlds: Array) -> None:
        self.state, rows = state, worlds.tolist()
        for i in rows:
            self.spaces[i].start(state.position[i], state.velocity[i], state.angle[i])
        self._eventful = sorted({*self._eventful, *rows})

    def step(self, command: Command) -> State:
        before, after = self.state, self.blank()
        goal, told, lifted = self._follow(command, before.position)
        if command.told is not None:
            self._lift(lifted, True)
        orders = np.ascontiguousarray(goal), told, lifted
        self.begin(command.shut)
        if AVAILABLE:
            step_quiet(*self._arguments(orders, before, after))
        else:
            self._leave_all(before, after)
        self._go_on(orders, after)
        if command.told is not None:
            after.velocity[:, : told.shape[1]][told] = command.told[told][:, 2:]
            self._lift(lifted, False)
        if self._turns:
            after = self._with_turns(after)
        self.state = after
        return after

    def stage(self, goal: Array, before: State, after: State) -> Stage:
        if self._turns or not AVAILABLE:
            raise Unchained("steps of squares, and on this system, need Python")
        orders = goal, self._nobody, self._nobody
        *arguments, left = self._arguments(orders, before, after)
        return Stage(step_quiet, (*arguments, Fixed(left)))

    def begin(self, shut: Array | None = None) -> None:
        shut = self._open if shut is None else shut
        if shut is not self._shut:
            for i in np.flatnonzero((shut != self._shut).any(-1)).tolist():
                self.spaces[i].shut(shut[i])
            self._shut = shut
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
            *(2 * self.cast.table.paddle_radius, self._flags, path),
            *(getattr(after, name) for name in RESULTS),
            self._left,
        )

    def _leave_all(self, before: State, after: State) -> None:
        """All worlds as they were, for Python to step."""
        for name in RESULTS:
            getattr(after, name)[...] = getattr(self.quiet, name)
        for name in ("position", "velocity"):
            getattr(after, name)[...] = getattr(before, name)
        after.time[...] = before.time + self.control_dt
        self._flags[:, SUBSTEP], self._left[0] = -1, self.num_worlds

    def _go_on(self, orders: tuple[Array, Array, Array], after: State) -> None:
        """Step the worlds that are not quiet to the end, and tell what happened."""
        position, velocity, path = after.position, after.velocity, after.path
        if self._left[0]:
            goal, told, lifted = orders
            for i in np.flatnonzero(self._flags[:, EVENT] | (not AVAILABLE)).tolist():
                own = None if path is None else path[i]
                hands = goal[i], told[i], lifted[i]
                self._finish(i, *hands, position[i], velocity[i], own)
        if path is not None:
            path[..., 2] += self._kicks[:, None, : path.shape[2]]
        for i in self._eventful:
            space = self.spaces[i]
            for name in EVENTS:
                getattr(after, name)[i] = getattr(space, name)
            for k, place in space.out.items():
                puck = self.cast.bodies.puck.start + k
                position[i, puck], velocity[i, puck] = place, 0.0

    def _finish(
        self,
        i: int,
        goal: Array,
        told: Array,
        lifted: Array,
        position: Array,
        velocity: Array,
        path: Array | None,
    ) -> None:
        """Step a world to the end of the control step, in place."""
        space, seats = self.spaces[i], len(goal)
        speeds = velocity[:seats].copy()
        space.step(position[:seats], speeds, goal, told, lifted, path)
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
        first = self.cast.bodies.block.start
        for i, space in enumerate(self.spaces):
            for k, body in enumerate(space.bodies[first:], start=first):
                angle[i, k], spin[i, k] = body.angle, body.angular_velocity
        return replace(state, angle=angle, spin=spin)


make = Pymunk
