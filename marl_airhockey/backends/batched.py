"""The 2D table for thousands of worlds at once: one compiled loop (`kernel`)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from marl_airhockey.backend import TOLD_SPEED, Backend, Command
from marl_airhockey.batch import LAWS, Events, Ground, Motion, Order, laws
from marl_airhockey.cast import Cast
from marl_airhockey.kernel import advance
from marl_airhockey.rails import sides
from marl_airhockey.state import Array, State, still_state
from marl_airhockey.table import GRAVITY
from marl_airhockey.threads import over_rows, spreads

KEPT = ("position", "velocity", "touching", "time")
"""The arrays of a state that the next step needs."""


class Batched(Backend):
    """B worlds as rows of arrays, stepped by numba."""

    exact: ClassVar[bool] = True
    default_substeps: ClassVar[int] = 10

    def __init__(
        self, cast: Cast, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(cast, num_worlds, control_dt, substeps)
        bodies = cast.bodies
        mouths = [(mouth.side, mouth.width is None) for mouth in cast.mouths]
        obstacles = [(*o.start, *(o.end or o.start), o.radius) for o in cast.obstacles]
        self._ground = Ground(
            bodies.paddles,
            bodies.pucks,
            bodies.blocks,
            np.array(bodies.radius),
            sides(cast),
            np.array(mouths, np.int64).reshape(-1, 2),
            np.array(obstacles, np.float64).reshape(-1, 5),
            control_dt,
            substeps,
        )
        self._laws = np.zeros((num_worlds, LAWS))
        self._quiet = still_state(bodies, num_worlds, len(mouths))
        self._rows = {name: getattr(self._quiet, name) for name in KEPT}
        self._leaning = np.zeros((num_worlds, bodies.pucks, len(mouths)), np.bool_)
        self._out = np.zeros((num_worlds, bodies.pucks), np.bool_)
        self._push = np.zeros((num_worlds, bodies.movers, 2))
        self._never = np.zeros((num_worlds, bodies.paddles), np.bool_)
        moments = substeps + 1 if cast.path else 0
        self._moments = (num_worlds, moments, bodies.movers, 4)

    @classmethod
    def supports(cls, cast: Cast) -> str | None:
        if cast.blocks and cast.block_shape != "disc":
            return 'square blocks are played by backend "pymunk"'
        if cast.blocks and any(mouth.width for mouth in cast.mouths):
            return "blocks could slide into a goal mouth; leave out one or the other"
        return None

    def set_physics(self, values: dict[str, Array], mask: Array) -> None:
        rows = {name: value[mask] for name, value in values.items()}
        rows["pull"] = GRAVITY * np.sin(np.radians(rows["tilt"]))
        self._laws[mask] = laws(rows, self.control_dt, self.substeps)

    def start(self, state: State, mask: Array) -> None:
        self._rows = {name: getattr(state, name) for name in KEPT}
        self._leaning[mask] = False
        self._out[mask] = False
        self._push[mask] = 0.0

    def step(self, command: Command) -> State:
        old, quiet = self._rows, self._quiet
        goal, told, lifted = command.velocity, self._never, self._never
        if command.told is not None:
            told = np.asarray(np.isfinite(command.told).all(-1))
            way = command.told[..., :2] - old["position"][:, : told.shape[1]]
            way /= self.control_dt
            goal = np.where(told[..., None], way, goal)
            lifted = told & (np.hypot(way[..., 0], way[..., 1]) > TOLD_SPEED)
        position, velocity = old["position"].copy(), old["velocity"].copy()
        path = np.empty(self._moments)
        events = Events(
            quiet.touched.copy(),
            quiet.touched_at.copy(),
            old["touching"].copy(),
            quiet.crossed.copy(),
            quiet.crossed_velocity.copy(),
            self._leaning,
            self._out,
        )
        order = Order(goal, told, lifted)
        motion = Motion(position, velocity, path, self._push)

        def work(rows: slice) -> None:
            some = Order(*[array[rows] for array in order])
            moved = Motion(*[array[rows] for array in motion])
            happened = Events(*[array[rows] for array in events])
            advance(self._ground, self._laws[rows], some, moved, happened)

        if spreads(self.num_worlds):
            over_rows(work, self.num_worlds)
        else:
            advance(self._ground, self._laws, order, motion, events)
        if command.told is not None:
            velocity[:, : told.shape[1]][told] = command.told[told][:, 2:]
        time = old["time"] + self.control_dt
        new = quiet.moved(position, velocity, time, path if self.cast.path else None)
        for name in (
            "touched",
            "touched_at",
            "touching",
            "crossed",
            "crossed_velocity",
        ):
            vars(new)[name] = getattr(events, name)
        self._rows = {name: getattr(new, name) for name in KEPT}
        return new


make = Batched
