"""The 2D table on pymunk (Chipmunk): B spaces stepped in a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from marl_airhockey.backend import Backend, Command
from marl_airhockey.cast import Cast
from marl_airhockey.chipmunk import AVAILABLE, EVENT, SUBSTEP, drift, new_flags
from marl_airhockey.space import Space
from marl_airhockey.state import EVENTS, Array, State


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
        old = self.state
        position, velocity = old.position.copy(), old.velocity.copy()
        path = np.empty(self._path_shape)
        goal, told, lifted = self._follow(command, position)
        if command.told is not None:
            self._lift(lifted, True)
        shut = self._open if command.shut is None else command.shut
        if shut is not self._shut:
            for i in np.flatnonzero((shut != self._shut).any(-1)).tolist():
                self.spaces[i].shut(shut[i])
            self._shut = shut
        for i in self._eventful:
            self.spaces[i].begin()
        for i in self._drift(goal, told, lifted, position, velocity, path):
            hands = goal[i], told[i], lifted[i]
            self._finish(i, *hands, position[i], velocity[i], path[i])
        time = old.time + self.control_dt
        moved = {"position": position, "velocity": velocity, "time": time}
        if self.cast.path:
            path[..., 2] += self._kicks[:, None, : path.shape[2]]
            moved["path"] = path
        new = self.quiet.having(moved)
        if self._eventful:
            new = self._with_events(new, self._eventful)
        if command.told is not None:
            new.velocity[:, : told.shape[1]][told] = command.told[told][:, 2:]
            self._lift(lifted, False)
        if self._turns:
            new = self._with_turns(new)
        self.state = new
        return new

    def _drift(
        self,
        goal: Array,
        told: Array,
        lifted: Array,
        position: Array,
        velocity: Array,
        path: Array,
    ) -> list[int]:
        """Step the quiet worlds in compiled code; those that Python must finish."""
        flags, self._eventful = self._flags, []
        if not AVAILABLE:
            flags[:, SUBSTEP] = -1
            return list(range(self.num_worlds))
        left = drift(
            self._worlds,
            goal,
            told,
            lifted,
            self._kicks,
            self.control_dt / self.substeps,
            self.substeps,
            2 * self.cast.table.paddle_radius,
            flags,
            position,
            velocity,
            path,
        )
        return flags[:, EVENT].nonzero()[0].tolist() if left else []

    def _finish(
        self,
        i: int,
        goal: Array,
        told: Array,
        lifted: Array,
        position: Array,
        velocity: Array,
        path: Array,
    ) -> None:
        """Step a world to the end of the control step, in place."""
        space, seats = self.spaces[i], len(goal)
        speeds = velocity[:seats].copy()
        path_or_none = path if self.cast.path else None
        space.step(position[:seats], speeds, goal, told, lifted, path_or_none)
        rows = space.read()
        position[: len(rows)], velocity[: len(rows)] = rows[:, :2], rows[:, 2:]
        velocity[: len(rows), 0] += self._kicks[i, : len(rows)]
        velocity[:seats] = speeds
        if self._flags[i, EVENT]:
            self._eventful.append(i)

    def _with_events(self, state: State, worlds: list[int]) -> State:
        """The state with the contacts and crossings of some worlds."""
        arrays = {name: getattr(self.quiet, name).copy() for name in EVENTS}
        puck = self.cast.bodies.puck.start
        for i in worlds:
            space = self.spaces[i]
            for name, array in arrays.items():
                array[i] = getattr(space, name)
            for k, place in space.out.items():
                state.position[i, puck + k] = place
                state.velocity[i, puck + k] = 0.0
        return state.having(arrays)

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
