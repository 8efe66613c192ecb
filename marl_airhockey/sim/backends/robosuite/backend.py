"""Robosuite backend: one UR5e for each seat on a table in MuJoCo."""

from __future__ import annotations

import copy
import importlib.util
import logging
import math
import os
from collections.abc import Sequence
from importlib import metadata
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from marl_airhockey.sim.backends._planar.paddles import follow
from marl_airhockey.sim.contracts.backend import Backend, Command
from marl_airhockey.sim.contracts.mark import Mark
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.sim.jit.threads import over_rows
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.sim.backends.robosuite.offscreen import OffscreenRenderer

NEWEST = "mujoco==3.9.0"
"""Newest release of MuJoCo that robosuite supports."""
MAX_TIMESTEP = 0.004
"""Longest physics step with which arms follow their command, s."""


class RobosuiteBackend(Backend):
    """Backend with B MuJoCo simulations of robosuite's model, stepped in compiled code.

    Paddles follow their commands within the limits of an arm, and pucks push them.
    Contacts last some milliseconds. A position-driven paddle moves at most at the top
    speed of its seat. ``trace`` is the motion of the arms at every physics step, see
    `arrays.TRACE`.
    """

    instant_contacts: ClassVar[bool] = False
    tracks_commands: ClassVar[bool] = False
    timestep: ClassVar[float | None] = 0.001
    viewpoints: ClassVar[tuple[str, ...]] = ("frontview", "agentview", "birdview")

    @classmethod
    def available(cls) -> str | None:
        for name in ("robosuite", "mujoco"):
            if importlib.util.find_spec(name) is None:
                return (
                    f"{name} is not installed: pip install 'marl_airhockey[robosuite]'"
                )
        version = metadata.version("mujoco")
        if tuple(int(n) for n in version.split(".")[:2]) > (3, 9):
            return f"mujoco {version} is too new for robosuite: pip install {NEWEST}"
        return None

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        table, seats = scene.table, scene.seats
        if table.vertices != TABLES["standard"].vertices:
            return "it supports only the standard table"
        sides = [seat.side for seat in seats]
        if len(set(sides)) < len(sides) or not set(sides) <= {0, 2}:
            return "it supports one arm at each end of the table"
        for i, seat in enumerate(seats):
            held = make_seat("robot", table, seat.side)
            if seat.reach != held.reach or seat.speed > held.speed:
                return f"an arm cannot cover the seat of paddle_{i}; use seats='robot'"
        if scene.blocks and any(goal_line.width for goal_line in scene.goal_lines):
            return "blocks could slide into a goal; remove the blocks or the goals"
        return None

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        control_dt: float,
        substeps: int | None = None,
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        substeps = self.substeps
        if control_dt / substeps > MAX_TIMESTEP:
            least = math.ceil(control_dt / MAX_TIMESTEP - 1e-9)
            raise ValueError(
                f"substeps: {substeps} are too few for an arm; use at least {least}"
            )
        self._dt = control_dt / substeps
        self.env = _make_env(scene, self._dt, control_dt)
        """Robosuite environment; all worlds copy its model."""
        from marl_airhockey.sim.backends.robosuite.arrays import (
            TRACE,
            make_static_scene,
        )
        from marl_airhockey.sim.backends.robosuite.simulation import Simulation

        env = self.env
        self._static = make_static_scene(scene, env.frame, env.hands)
        model, data = env.physics_model(), env.sim.data._data
        path = substeps + 1 if scene.path else 0, scene.bodies.movers, 4
        self.trace = np.zeros((num_worlds, substeps, len(scene.seats), len(TRACE)))
        self.worlds = [
            Simulation(env, copy.copy(model), path, self.trace[i], data)
            for i in range(num_worlds)
        ]
        self._last_goal = np.zeros((num_worlds, len(scene.seats), 2))
        self._renderers: dict[int, OffscreenRenderer] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return the content of a copy, which opens OpenGL contexts of its own."""
        return {
            "arguments": (self.scene, self.num_worlds, self.control_dt, self.substeps),
            "worlds": [world.save() for world in self.worlds],
            "last_goal": self._last_goal.copy(),
            "before": self._before,
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        RobosuiteBackend.__init__(self, *saved["arguments"])
        for world, row in zip(self.worlds, saved["worlds"], strict=True):
            world.restore(self._static, row)
        self._last_goal[:] = saved["last_goal"]
        self._before = saved["before"]

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        for i in worlds.tolist():
            row = {name: float(value[i]) for name, value in values.items()}
            self.worlds[i].set_physics(row)

    def reset(self, state: State, worlds: Array) -> None:
        super().reset(state, worlds)
        for i in worlds.tolist():
            new = self.worlds[i].reset(
                *(self._static, state.position[i], state.velocity[i]),
                *(state.angle[i], state.spin[i]),
            )
            if new:
                self._last_goal[i] = 0.0

    def stage(self, command: Command, before: State, after: State) -> Stage:
        return Stage(self._move, (command, before, after))

    def _move(self, command: Command, before: State, after: State) -> None:
        """Fill ``after`` with the state one control step after ``before``."""
        from marl_airhockey.sim.backends.robosuite.stepper import advance

        goal = self._goal(command, before)
        starts = [
            world.advance_reference(self._last_goal[i], goal[i], self.control_dt)
            for i, world in enumerate(self.worlds)
        ]

        def move(rows: slice) -> None:
            for i in range(*rows.indices(self.num_worlds)):
                world = self.worlds[i]
                advance(
                    *(world.views, self._static, world.output),
                    *(starts[i], self._last_goal[i], goal[i]),
                    *(self._dt, self.substeps),
                )

        over_rows(move, self.num_worlds, least=1)
        after.time[:] = before.time + self.control_dt
        after.position[:] = before.position
        for i, world in enumerate(self.worlds):
            world.park_pucks()
            world.read(after, i)
        self._last_goal[:] = goal

    def _goal(self, command: Command, before: State) -> Array:
        """Return velocities at the end of the step (B, seats, 2), table frame, m/s."""
        goal = np.zeros(command.velocity.shape)
        seats = goal.shape[:2]
        imposed, raised = np.zeros(seats, np.bool_), np.zeros(seats, np.bool_)
        ways = *command[:2], command.raised, before.position
        follow(*ways, self.control_dt, goal, imposed, raised)
        top = np.array([seat.speed for seat in self.scene.seats])[:, None]
        size = np.hypot(goal[..., 0], goal[..., 1])[..., None]
        slow = np.minimum(1.0, top / np.maximum(size, 1e-9))
        return np.where(imposed[..., None], goal * slow, goal)

    def photograph(
        self, world: int, viewpoint: str, marks: Sequence[Mark], width: int
    ) -> Array:
        from marl_airhockey.sim.backends.robosuite.offscreen import OffscreenRenderer

        if width not in self._renderers:
            model, height = self.env.sim.model._model, round(width * 0.6)
            self._renderers[width] = OffscreenRenderer(
                model, self.env.frame, width, height
            )
        qpos = self.worlds[world].data.qpos
        return self._renderers[width].picture(qpos, viewpoint, marks)

    def close(self) -> None:
        for renderer in self._renderers.values():
            renderer.close()
        self.env.close()


def _make_env(scene: Scene, timestep: float, control_dt: float) -> Any:
    """Return a robosuite environment of a scene, reset."""
    # Render without a display. MuJoCo reads the variable at its import.
    os.environ.setdefault("MUJOCO_GL", "egl")
    # Robosuite warns about optional files; show only its errors.
    log = logging.getLogger("robosuite_logs")
    log.addFilter(lambda record: record.levelno >= logging.ERROR)
    from marl_airhockey.sim.backends.robosuite.env import AirHockey

    env: Any = AirHockey(scene=scene, timestep=timestep, control_freq=1 / control_dt)
    env.reset()
    return env


make = RobosuiteBackend
