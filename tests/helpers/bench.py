"""One world of a backend with bodies where a test wants them."""

from dataclasses import replace

import numpy as np

from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.parameters import PARAMETERS, PRESETS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

TABLE = TABLES["standard"]
DT = 0.05
FLAT = {name: p.default for name, p in PARAMETERS.items()} | {
    **PRESETS["frictionless"],
    "tilt": 0.0,
}
"""A flat table without drag and friction, which has closed forms."""


class Bench:
    def __init__(
        self, backend, physics=None, pucks=1, table=TABLE, obstacles=(), **scene
    ):
        table = replace(table, obstacles=obstacles)
        self.scene = Scene(table, (make_seat("robot", table, 0),), pucks=pucks, **scene)
        kind = find_backend(backend)
        self.refused = kind.supports(self.scene)
        self.backend = kind(self.scene, 1, DT)
        values = FLAT | (physics or {})
        rows = {name: np.full(1, value) for name, value in values.items()}
        self.backend.set_physics(rows, np.arange(1))

    def reset(self, paddle, *others):
        """Place the paddle at (x, y) and the others at (x, y, vx, vy)."""
        state = self.scene.still_state(1)
        state.position[0, 0] = paddle
        for i, (x, y, vx, vy) in enumerate(others, start=1):
            state.position[0, i], state.velocity[0, i] = (x, y), (vx, vy)
        self.backend.reset(state, np.arange(1))
        return state

    def run(self, seconds, velocity=(0.0, 0.0)):
        command = self.command(velocity)
        return [self.backend.step(command) for _ in range(round(seconds / DT))]

    def command(self, velocity=(0.0, 0.0), prescribed=np.nan):
        """A command to the paddle, (2,) m/s, or (4,) where it is prescribed."""
        still = Command.still(self.scene, 1)
        still.velocity[:], still.prescribed[:] = velocity, prescribed
        return still
