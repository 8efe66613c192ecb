"""Pymunk backend: B pymunk spaces that a loop steps."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from marl_airhockey.sim.backends._planar.paddles import follow
from marl_airhockey.sim.backends.pymunk.space import Space
from marl_airhockey.sim.contracts.backend import Backend, Command
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import EVENTS, State
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.types import Array


class PymunkBackend(Backend):
    """Backend with B worlds in plain Python on Chipmunk, a reference for the others."""

    timestep: ClassVar[float | None] = 0.005

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        control_dt: float,
        substeps: int | None = None,
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        self.spaces = [
            Space(scene, control_dt, self.substeps) for _ in range(num_worlds)
        ]
        self._closed = np.zeros((num_worlds, len(scene.goal_lines)), np.bool_)

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        if scene.blocks and any(line.width for line in scene.goal_lines):
            return "blocks could slide into a goal; remove the blocks or the goals"
        return None

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        for i in worlds.tolist():
            row = {name: float(value[i]) for name, value in values.items()}
            self.spaces[i].set_physics(row)

    def key_scatter(self, keys: Array, worlds: Array) -> None:
        for i in worlds.tolist():
            self.spaces[i].key_scatter(keys[i])

    def reset(self, state: State, worlds: Array) -> None:
        super().reset(state, worlds)
        for i in worlds.tolist():
            self.spaces[i].reset(
                *(state.position[i], state.velocity[i], state.angle[i], state.spin[i]),
                state.touching[i],
            )

    def stage(self, command: Command, before: State, after: State) -> Stage:
        return Stage(self._move, (command, before, after))

    def _move(self, command: Command, before: State, after: State) -> None:
        """Fill ``after`` with the state one control step after ``before``."""
        seats = command.velocity.shape[:2]
        goal = np.zeros((*seats, 2))
        imposed, raised = np.zeros(seats, np.bool_), np.zeros(seats, np.bool_)
        ways = *command[:2], command.raised, before.position
        follow(*ways, self.control_dt, goal, imposed, raised)
        after.time[:] = before.time + self.control_dt
        for name in ("position", "velocity", "angle", "spin"):
            getattr(after, name)[:] = getattr(before, name)
        for i in np.flatnonzero((command.closed != self._closed).any(-1)).tolist():
            self.spaces[i].close_goals(command.closed[i])
        self._closed[:] = command.closed
        rows = np.zeros((self.scene.bodies.movers, 4))
        for i, space in enumerate(self.spaces):
            paddles = (
                before.position[i, : seats[1]].copy(),
                before.velocity[i, : seats[1]].copy(),
            )
            path = None if after.path is None else after.path[i]
            space.step(paddles, (goal[i], imposed[i], raised[i]), path)
            space.read(rows, paddles[1])
            rows[: seats[1], :2] = paddles[0]
            after.position[i, : len(rows)] = rows[:, :2]
            after.velocity[i, : len(rows)] = rows[:, 2:]
            space.read_angles(after.angle[i], after.spin[i])
            for name in EVENTS:
                getattr(after, name)[i] = getattr(space, name)
        np.copyto(
            after.velocity[:, : seats[1]],
            command.prescribed[..., 2:],
            where=imposed[..., None],
        )


make = PymunkBackend
