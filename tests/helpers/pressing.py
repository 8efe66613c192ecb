"""Worlds in which paddles press pucks wherever a test wants them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.geometry import clip
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.core.table import Table
from marl_airhockey.sim.world.world import World
from marl_airhockey.toolkit import observables

LIMITS = {"robot": (0.7, 7.0), "arcade": (5.0, 50.0)}


@dataclass(frozen=True, kw_only=True)
class Pressing(Scenario):
    """Paddles that may go anywhere on a regular table, each from its own place."""

    corners: int = 4
    paddles: int = 1
    pucks: int = 1
    blocks: int = 0
    limits: str = "arcade"
    tilt: float = 5.5
    seconds: float = 1e9

    @property
    def table_geometry(self):
        return Table.regular(self.corners, 0.45)

    @cached_property
    def scene(self):
        table, seats = self.table_geometry, []
        speed, acceleration = LIMITS[self.limits]
        for i in range(self.paddles):
            ego = table.rotation(0).T
            reach = np.asarray(table.vertices) @ ego
            for normal, offset in zip(table.normals @ ego, table.offsets, strict=True):
                reach = clip(reach, normal, offset - table.paddle_radius)
            corners = tuple((float(x), float(y)) for x, y in reach)
            seats.append(Seat(0, corners, speed, acceleration, i))
        return Scene(
            table,
            tuple(seats),
            pucks=self.pucks,
            blocks=self.blocks,
            block_radius=0.03175,
            physics={"tilt": self.tilt},
        )

    def reset(self, rng, worlds):
        state = self.scene.still_state(worlds)
        return state, self.initial_memory(state, rng)

    @property
    def observation(self):
        return (observables.OwnPaddle(),)

    def reward_terms(self, t):
        return {"nothing": 0.0 * t.after.paddle[..., 0]}

    def success(self, t):
        return t.after.time < 0.0


def press_world(worlds, backend="numba", physics=None, control_dt=0.05, **options):
    game = Pressing(**options)
    kind = find_backend(backend)
    made = kind(game.scene, worlds, control_dt)
    world = World(game, made, {}, Physics(game.scene.defaults, given=physics))
    world.reset(0)
    return world


def overlap(scene, state):
    """(B,) deepest overlap of pucks and blocks with anything, m."""
    deep = np.full(len(state.time), -1.0)
    bodies, table = scene.bodies, scene.table
    for j in range(bodies.paddles, bodies.movers):
        x, radius = state.position[:, j], bodies.radius[j]
        wall = (x @ table.normals.T + table.offsets).min(1)
        deep = np.maximum(deep, radius - wall)
        for i in range(j):
            gap = np.linalg.norm(x - state.position[:, i], axis=1)
            deep = np.maximum(deep, radius + bodies.radius[i] - gap)
    return deep


def press(world, seconds, aim=None, stop=None):
    """Chase pucks for some time, then rest; yield every state."""
    scene = world.scene
    steps = round(seconds / world.control_dt)
    for k in range(2 * steps):
        state = world.state
        target = state.position[:, scene.bodies.paddles :].mean(1, keepdims=True)
        wanted = 60 * (target - state.paddle)
        rotation = world.reach.rotation
        ego = np.einsum("sij,bsj->bsi", rotation, wanted)
        top = scene.seats[0].speed
        action = ego / top
        action /= np.maximum(np.linalg.norm(action, axis=-1, keepdims=True), 1.0)
        if k >= steps:
            action[:] = 0.0
        world.step(action)
        yield world.state
