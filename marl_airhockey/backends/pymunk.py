"""The 2D table on pymunk (Chipmunk): B spaces stepped in a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from marl_airhockey.backend import TOLD_SPEED, Backend, Command
from marl_airhockey.cast import Cast
from marl_airhockey.chipmunk import AVAILABLE, EVENT, SUBSTEP, drift, new_flags
from marl_airhockey.space import Space
from marl_airhockey.state import Array, State, still_state


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
        self._drifts = AVAILABLE and len(cast.seats) == 1
        mouths = len(cast.mouths)
        self.state = still_state(cast.bodies, num_worlds, mouths)
        self._steps = np.zeros(num_worlds, np.int64)
        self._kicks = np.zeros((num_worlds, 1, 1))
        self._never = np.zeros((num_worlds, len(cast.seats)), np.bool_)
        self._quiet = still_state(cast.bodies, num_worlds, mouths)
        self._turns = cast.blocks > 0 and cast.block_shape == "square"

    @classmethod
    def supports(cls, cast: Cast) -> str | None:
        if cast.blocks and any(mouth.width for mouth in cast.mouths):
            return "blocks could slide into a goal mouth; leave out one or the other"
        return None

    def set_physics(self, values: dict[str, Array], mask: Array) -> None:
        for i in np.flatnonzero(mask):
            row = {name: float(value[i]) for name, value in values.items()}
            self.spaces[i].set_physics(row)
            self._kicks[i] = self.spaces[i].kick

    def start(self, state: State, mask: Array) -> None:
        everywhere = len(state.time) == self.num_worlds
        self.state = state if everywhere else self.state.scatter(mask, state)
        for row, i in enumerate(np.flatnonzero(mask)):
            position, velocity = state.position[row], state.velocity[row]
            self.spaces[i].start(position, velocity, state.angle[row])
        self._steps[mask] = np.round(state.time / self.control_dt).astype(np.int64)

    def step(self, command: Command) -> State:
        old, bodies, s = self.state, self.cast.bodies, len(self.cast.seats)
        position = old.position[:, :s].copy()
        velocity = old.velocity[:, :s].copy()
        goal, told, lifted = command.velocity, self._never, None
        if command.told is not None:
            goal, told, lifted = self._follow(position, command.told, goal)
        moments = self.substeps + 1 if self.cast.path else 1
        ways = np.empty((self.num_worlds, moments, bodies.movers, 4))
        path, rows = ways if self.cast.path else None, ways[:, -1]
        flags = self._flags
        for i in flags[:, EVENT].nonzero()[0].tolist():
            self.spaces[i].begin()
        for i in self._drift(velocity, goal, lifted is not None, ways):
            way, space = None if path is None else path[i], self.spaces[i]
            space.step(position[i], velocity[i], goal[i], told[i], way)
            rows[i] = space.read()
        eventful = flags[:, EVENT].nonzero()[0].tolist()
        rows[:, :s, 2:] = velocity
        ways[:, :, bodies.puck, 2] += self._kicks
        self._steps += 1
        place, speed = rows[..., :2], rows[..., 2:]
        if len(bodies) > bodies.movers:
            place = np.concatenate([place, old.position[:, bodies.movers :]], 1)
            speed = np.concatenate([speed, old.velocity[:, bodies.movers :]], 1)
        new = self._quiet.moved(
            place, speed, self._steps * self.control_dt, path, bool(eventful)
        )
        if eventful:
            new = self._with_events(new, eventful)
        if command.told is not None:
            self._land(new, command.told, lifted)
        if self._turns:
            new = self._with_turns(new)
        self.state = new
        return new

    def _drift(
        self, velocity: Array, goal: Array, any_told: bool, ways: Array
    ) -> list[int]:
        """Step the quiet worlds in compiled code; those that Python must finish."""
        flags = self._flags
        if not self._drifts or any_told:
            flags[:, SUBSTEP] = -1
            return list(range(self.num_worlds))
        sim_dt = self.control_dt / self.substeps
        start = velocity[:, 0].copy()
        end = goal[:, 0]
        drift(self._worlds, start, end, sim_dt, self.substeps, flags, ways)
        left: list[int] = flags[:, EVENT].nonzero()[0].tolist()
        velocity[:, 0] = goal[:, 0]
        for i in left:
            velocity[i, 0] = start[i]
        return left

    def _with_events(self, state: State, worlds: list[int]) -> State:
        """The state with the contacts and crossings of some worlds."""
        quiet, names = self._quiet, ("touched", "touched_at", "touching", "crossed")
        arrays = {n: getattr(quiet, n).copy() for n in (*names, "crossed_velocity")}
        puck = self.cast.bodies.puck.start
        for i in worlds:
            space = self.spaces[i]
            for name, array in arrays.items():
                array[i] = getattr(space, name)
            for k, place in space.out.items():
                state.position[i, puck + k] = place
                state.velocity[i, puck + k] = 0.0
        return replace(state, **arrays)

    def _follow(
        self, position: Array, told: Array, goal: Array
    ) -> tuple[Array, Array, Array]:
        """Velocities, who is told and who is lifted, for a command with told seats."""
        is_told = np.asarray(np.isfinite(told).all(-1))
        way = (told[..., :2] - position) / self.control_dt
        lifted = is_told & (np.hypot(way[..., 0], way[..., 1]) > TOLD_SPEED)
        for i, k in zip(*np.nonzero(lifted), strict=True):
            self.spaces[i].lift(int(k), True)
        return np.where(is_told[..., None], way, goal), is_told, lifted

    def _land(self, new: State, told: Array, lifted: Array | None) -> None:
        is_told = np.isfinite(told).all(-1)
        new.velocity[:, : told.shape[1]][is_told] = told[is_told][:, 2:]
        assert lifted is not None
        for i, k in zip(*np.nonzero(lifted), strict=True):
            self.spaces[i].lift(int(k), False)

    def _with_turns(self, state: State) -> State:
        angle, spin = np.zeros((2, *state.time.shape, len(state.bodies)))
        first = self.cast.bodies.block.start
        for i, space in enumerate(self.spaces):
            for k, body in enumerate(space.bodies[first:], start=first):
                angle[i, k], spin[i, k] = body.angle, body.angular_velocity
        return replace(state, angle=angle, spin=spin)


make = Pymunk
