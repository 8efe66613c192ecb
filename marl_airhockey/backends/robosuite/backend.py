"""Robosuite backend: a UR5e a seat on a table in MuJoCo, built with robosuite."""

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

from marl_airhockey.backends._planar.paddles import follow
from marl_airhockey.backends._planar.walls import sides
from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.contracts.mark import Mark
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.state import State
from marl_airhockey.core.table import TABLES
from marl_airhockey.jit.pipeline import Stage
from marl_airhockey.jit.threads import over_rows
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.backends.robosuite.camera import Camera

NEWEST = "mujoco==3.9.0"
COARSEST = 0.004
"""s of a physics step; with longer ones arms no longer follow."""


class RobosuiteBackend(Backend):
    """B MuJoCo simulations of robosuite's model, stepped in compiled code.

    Paddles track their command as an arm can, and feel the pucks; contacts take some
    milliseconds. A prescribed paddle goes there at its seat's top speed at most.
    ``trace`` holds the motion of the arms at every physics step: see `stepper.TRACE`.
    """

    exact: ClassVar[bool] = True
    ideal: ClassVar[bool] = False
    default_substeps: ClassVar[int] = 50
    cameras: ClassVar[tuple[str, ...]] = ("frontview", "agentview", "birdview")

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
            return "arms are placed for the standard table"
        sides = [seat.side for seat in seats]
        if len(set(sides)) < len(sides) or not set(sides) <= {0, 2}:
            return "there is room for one arm at each end"
        for i, seat in enumerate(seats):
            held = make_seat("robot", table, seat.side)
            if seat.reach != held.reach or seat.speed > held.speed:
                return f"an arm cannot hold the seat of paddle_{i}: say seats='robot'"
        if scene.blocks and any(goal_line.width for goal_line in scene.goal_lines):
            return "blocks could slide into a goal line; leave out one or the other"
        return None

    def __init__(
        self, scene: Scene, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(scene, num_worlds, control_dt, substeps)
        if control_dt / substeps > COARSEST:
            least = math.ceil(control_dt / COARSEST - 1e-9)
            raise ValueError(
                f"substeps: {substeps} are too few to hold an arm: at least {least}"
            )
        # Without a screen; MuJoCo reads it when it is imported.
        os.environ.setdefault("MUJOCO_GL", "egl")
        # Robosuite warns of files that nobody needs; errors are shown.
        log = logging.getLogger("robosuite_logs")
        log.addFilter(lambda record: record.levelno >= logging.ERROR)
        from marl_airhockey.backends.robosuite.env import AirHockey
        from marl_airhockey.backends.robosuite.simulation import Arms
        from marl_airhockey.backends.robosuite.stepper import TRACE, StaticScene

        self._dt = control_dt / substeps
        env: Any = AirHockey(
            scene=scene, timestep=self._dt, control_freq=1 / control_dt
        )
        env.reset()
        model, data = env.lean_model(), env.sim.data._data
        self.env = env
        """The robosuite environment whose model all worlds copy."""
        place, goal_lines = env.place, scene.goal_lines
        self._static = StaticScene(
            origin=place.origin,
            rotation=place.rotation,
            grips=np.array([hand.grip for hand in env.hands]),
            low=np.array([hand.low for hand in env.hands]),
            high=np.array([hand.high for hand in env.hands]),
            radius=np.array([scene.table.paddle_radius, scene.table.puck_radius]),
            pucks=scene.pucks,
            normals=np.array([scene.table.normals[m.side] for m in goal_lines]).reshape(
                -1, 2
            ),
            offsets=np.array([scene.table.offsets[m.side] for m in goal_lines]),
            ways=np.array([scene.opening(m) for m in goal_lines]).reshape(-1, 2, 2),
            sides=sides(scene),
            whole=np.array([m.width is None for m in goal_lines], np.bool_),
        )
        moments = substeps + 1 if scene.path else 0
        path = moments, scene.bodies.movers, 4
        self.trace = np.zeros((num_worlds, substeps, len(scene.seats), len(TRACE)))
        self.worlds = [
            Arms(env, copy.copy(model), path, self.trace[i], data)
            for i in range(num_worlds)
        ]
        self._last_goal = np.zeros((num_worlds, len(scene.seats), 2))
        self._cameras: dict[int, Camera] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy is built from; OpenGL contexts are left behind."""
        return {
            "arguments": (self.scene, self.num_worlds, self.control_dt, self.substeps),
            "worlds": [world.saved() for world in self.worlds],
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
                self._static, state.position[i], state.velocity[i], state.angle[i]
            )
            if new:
                self._last_goal[i] = 0.0

    def stage(self, command: Command, before: State, after: State) -> Stage:
        return Stage(self._move, (command, before, after))

    def _move(self, command: Command, before: State, after: State) -> None:
        """Fill ``after`` with the state a control step after ``before``."""
        from marl_airhockey.backends.robosuite.stepper import advance

        goal = self._goal(command, before)
        leads = [
            world.lead(self._last_goal[i], goal[i], self.control_dt)
            for i, world in enumerate(self.worlds)
        ]

        def move(rows: slice) -> None:
            for i in range(*rows.indices(self.num_worlds)):
                world = self.worlds[i]
                advance(
                    *(world.sim, self._static, world.output),
                    *(leads[i], self._last_goal[i], goal[i]),
                    *(self._dt, self.substeps),
                )

        over_rows(move, self.num_worlds, least=1)
        after.time[:] = before.time + self.control_dt
        after.position[:] = before.position
        for i, world in enumerate(self.worlds):
            world.retire()
            world.read(after, i)
        self._last_goal[:] = goal

    def _goal(self, command: Command, before: State) -> Array:
        """(B, seats, 2) m/s that arms are to reach; prescribed ones at top speed."""
        goal = np.zeros(command.velocity.shape)
        seats = goal.shape[:2]
        imposed, lifted = np.zeros(seats, np.bool_), np.zeros(seats, np.bool_)
        motion = command.velocity, command.prescribed, before.position
        follow(*motion, self.control_dt, goal, imposed, lifted)
        top = np.array([seat.speed for seat in self.scene.seats])[:, None]
        size = np.hypot(goal[..., 0], goal[..., 1])[..., None]
        slow = np.minimum(1.0, top / np.maximum(size, 1e-9))
        return np.where(imposed[..., None], goal * slow, goal)

    def photograph(
        self, world: int, camera: str, marks: Sequence[Mark], width: int
    ) -> Array:
        from marl_airhockey.backends.robosuite.camera import Camera

        if width not in self._cameras:
            model, height = self.env.sim.model._model, round(width * 0.6)
            self._cameras[width] = Camera(model, self.env.place, width, height)
        places = self.worlds[world].data.qpos
        return self._cameras[width].picture(places, camera, marks)

    def close(self) -> None:
        for camera in self._cameras.values():
            camera.close()
        self.env.close()


make = RobosuiteBackend
