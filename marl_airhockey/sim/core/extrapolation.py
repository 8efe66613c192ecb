"""Extrapolation of pucks over a short free flight, including wall bounces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array

LEGS = 4
"""Largest number of straight legs of a flight. It ends at the wall where one more leg
would begin."""


@dataclass(frozen=True)
class Walls:
    """Walls of a table as limits for the centres of its pucks, with closed goals.

    Bounces are those of a puck without spin at 1 m/s, with the default parameters of
    the scene.
    """

    normals: Array
    """Inward unit normals (sides, 2)."""
    offsets: Array
    """Distances from the origin (sides,), m."""
    restitution: float
    friction: float

    @staticmethod
    def of(scene: Scene) -> Walls:
        """Return the walls of a scene in the table frame."""
        names = "wall_restitution", "wall_friction"
        usual = {name: PARAMETERS[name].default for name in names}
        wall = [scene.defaults.get(name, usual[name]) for name in names]
        table = scene.table
        return Walls(table.normals, table.offsets - table.puck_radius, *wall)

    def rotated(self, rotation: Array) -> Walls:
        """Return the walls in a frame that is rotated about the origin."""
        normals = products(self.normals, rotation)
        return Walls(normals, self.offsets, self.restitution, self.friction)


def extrapolate(
    position: Array, velocity: Array, time: float, walls: Walls
) -> tuple[Array, Array]:
    """Predict pucks with walls, but without paddles, air drag and spin.

    Args:
        position: Positions (..., 2), m.
        velocity: Velocities (..., 2), m/s.
        time: Time of the prediction, s.
        walls: Walls in the frame of the pucks.

    Returns:
        Positions and velocities (..., 2), m and m/s.
    """
    x, y = position[..., 0], position[..., 1]
    vx, vy = velocity[..., 0], velocity[..., 1]
    left = time + 0.0 * x
    for _ in range(LEGS):
        due, nx, ny = left, 0.0 * x, 0.0 * x
        for (ax, ay), offset in zip(walls.normals, walls.offsets, strict=True):
            nearing = -(vx * ax + vy * ay)
            gap = np.maximum(x * ax + y * ay + offset, 0.0)
            reached = (nearing > 0.0) & (gap < due * nearing)
            due = np.where(reached, gap / np.where(reached, nearing, 1.0), due)
            nx, ny = np.where(reached, ax, nx), np.where(reached, ay, ny)
        x, y, left = x + vx * due, y + vy * due, left - due
        closing, slip = -(vx * nx + vy * ny), vy * nx - vx * ny
        push = (1.0 + walls.restitution) * closing
        grip = walls.friction * push
        # An impulse of a third of the slip ends the slip of a disc that can spin, see
        # `laws.impulse`.
        drag = np.minimum(np.maximum(-slip / 3.0, -grip), grip)
        vx, vy = vx + push * nx - drag * ny, vy + push * ny + drag * nx
    return np.stack([x, y], -1), np.stack([vx, vy], -1)


def extrapolate_rows(
    position: Array, velocity: Array, time: float, walls: Walls
) -> tuple[Array, Array]:
    """Run `extrapolate` as compiled code for float64 arrays (W, pucks, 2).

    Scripted drivers predict in every step. For so few rows, numpy calls would be most
    of the cost of a league.
    """
    position_after, velocity_after = np.empty(position.shape), np.empty(velocity.shape)
    _extrapolate_rows(
        position,
        velocity,
        time,
        walls.normals,
        walls.offsets,
        walls.restitution,
        walls.friction,
        position_after,
        velocity_after,
    )
    return position_after, velocity_after


@compiled(error_model="numpy")
def _extrapolate_rows(
    position: Array,
    velocity: Array,
    time: float,
    normals: Array,
    offsets: Array,
    restitution: float,
    friction: float,
    position_after: Array,
    velocity_after: Array,
) -> None:
    """Fill positions and velocities (W, pucks, 2) after a flight, see `extrapolate`."""
    for w in range(position.shape[0]):
        for p in range(position.shape[1]):
            x, y, vx, vy = (
                position[w, p, 0],
                position[w, p, 1],
                velocity[w, p, 0],
                velocity[w, p, 1],
            )
            left = time
            for _ in range(LEGS):
                due, nx, ny = left, 0.0, 0.0
                for k in range(len(offsets)):
                    ax, ay = normals[k, 0], normals[k, 1]
                    nearing = -(vx * ax + vy * ay)
                    gap = max(x * ax + y * ay + offsets[k], 0.0)
                    if nearing > 0.0 and gap < due * nearing:
                        due, nx, ny = gap / nearing, ax, ay
                x, y, left = x + vx * due, y + vy * due, left - due
                closing, slip = -(vx * nx + vy * ny), vy * nx - vx * ny
                push = (1.0 + restitution) * closing
                grip = friction * push
                drag = min(max(-slip / 3.0, -grip), grip)
                vx, vy = vx + push * nx - drag * ny, vy + push * ny + drag * nx
            position_after[w, p, 0], position_after[w, p, 1] = x, y
            velocity_after[w, p, 0], velocity_after[w, p, 1] = vx, vy
