"""World of the pymunk backend: a space with paddles, pucks, blocks, walls and goals.

Velocities in a space are half a substep ahead (leapfrog), so that a falling puck
follows its parabola exactly; `leapfrog_offset` is added when they are read.
"""

from __future__ import annotations

import numpy as np
import pymunk

from marl_airhockey.backends._planar.paddles import ramp_paddles
from marl_airhockey.backends._planar.walls import SQUEEZE, sides, slide_out, wall
from marl_airhockey.backends.pymunk.building import (
    BLOCK,
    EVERYTHING,
    GOAL_LINE,
    NOTHING,
    PADDLE,
    PUCK,
    WALL,
    Bodies,
    Walls,
)
from marl_airhockey.core.physics import PARAMETERS, PUCK_SPEED_CAP
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.table import GRAVITY
from marl_airhockey.types import Array

POCKET = 100.0
"""Coordinate of pucks out of play, far from the table (m)."""
ARM = 0.765
"""Mean distance of a square's points from its centre, per half of its side."""


class Space:
    """Space: one world in Chipmunk.

    Args:
        scene: scene of the world.
        control_dt: length of a control step, s.
        substeps: number of physics steps in a control step.
    """

    def __init__(self, scene: Scene, control_dt: float, substeps: int) -> None:
        self.scene, self.substeps = scene, substeps
        self.dt = control_dt / substeps
        self.space = space = pymunk.Space()
        # Overlap is removed at once; resting contacts keep a tenth of a millimetre.
        space.collision_slop, space.collision_bias = 1e-4, 0.0
        bodies, lines = scene.bodies, len(scene.goal_lines)
        pairs, table_sides = (bodies.paddles, bodies.pucks), len(scene.table.vertices)
        self.touched = np.zeros(pairs, np.int64)
        self.touched_at = np.full(pairs, np.nan)
        self.touching = np.zeros(pairs, np.bool_)
        self.banked = np.zeros((bodies.pucks, table_sides), np.int64)
        self.crossed = np.zeros((bodies.pucks, lines), np.bool_)
        self.crossed_velocity = np.zeros((bodies.pucks, lines, 2))
        self.bodies, self._walls = Bodies(space, scene), Walls(space, scene)
        self._sides, self._substep = sides(scene), 0
        self._out: dict[int, tuple[float, float]] = {}
        """Positions at which pucks left play, by puck, m."""
        self._initial_contacts: set[tuple[int, int]] = set()
        """Pairs of puck and side in contact at a reset, which is no new bounce."""
        self._contact = False
        """True if a paddle touches a puck, or a puck has crossed a goal line."""
        space.on_collision(PADDLE, PUCK, begin=self._touch, separate=self._part)
        space.on_collision(PUCK, GOAL_LINE, begin=self._cross)
        space.on_collision(PUCK, WALL, begin=self._bank)
        for kind in (PADDLE, WALL, GOAL_LINE, BLOCK):
            space.on_collision(BLOCK, kind, pre_solve=self._soften)
        self.set_physics({name: p.default for name, p in PARAMETERS.items()})

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters by name."""
        pull = GRAVITY * np.sin(np.radians(values["tilt"]))
        self.space.gravity = (-float(pull), 0.0)
        self.space.damping = float(np.exp(-values["puck_damping"]))
        self.leapfrog_offset = 0.5 * self.dt * float(pull)
        bodies, half = self.scene.bodies, self.scene.block_radius
        for shape in self._walls.all:
            shape.elasticity = values["wall_restitution"]
        for shape in self.bodies.shapes[bodies.paddle]:
            shape.elasticity = values["paddle_restitution"]
        for body in self.bodies.all[bodies.puck]:
            body.mass = values["puck_mass"]
        mass, friction = values["block_mass"], values["block_friction"]
        for i, body in enumerate(self.bodies.all[bodies.block]):
            self.bodies.shapes[bodies.block][i].elasticity = values["block_restitution"]
            body.mass = mass
            self.bodies.friction_joints[2 * i].max_force = mass * friction
            self.bodies.friction_joints[2 * i + 1].max_force = (
                mass * friction * ARM * half
            )
            if self.scene.block_shape == "square":
                body.moment = mass * (2 * half) ** 2 / 6

    def reset(
        self, position: Array, velocity: Array, angle: Array, touching: Array
    ) -> None:
        """Place all bodies and set the contacts that exist already.

        Shapes are removed and added in order, which clears Chipmunk's contact caches:
        equal initial states give equal episodes.

        Args:
            position: (N, 2) m.
            velocity: (N, 2) m/s.
            angle: (N,) rad.
            touching: (paddles, pucks) bool.
        """
        self.space.remove(*self.bodies.shapes)
        self.space.add(*self.bodies.shapes)
        pucks = self.scene.bodies.puck
        for i, body in enumerate(self.bodies.all):
            x, y = position[i].tolist()
            vx, vy = velocity[i].tolist()
            ahead = self.leapfrog_offset * (pucks.start <= i < pucks.stop)
            body.position, body.velocity = (x, y), (vx - ahead, vy)
            if i >= pucks.stop:
                body.angle, body.angular_velocity = float(angle[i]), 0.0
            self.space.reindex_shapes_for_body(body)
        self._out.clear()
        self.touching[:] = touching
        radius = self.scene.table.puck_radius
        self._contact = True
        self._initial_contacts = {
            (k, side)
            for k, (x, y) in enumerate(position[pucks].tolist())
            for side in range(len(self._sides))
            if wall(self._sides[side : side + 1], radius, x, y, 0.0) == 0
        }

    def step(
        self,
        paddles: tuple[Array, Array],
        command: tuple[Array, Array, Array],
        path: Array | None,
    ) -> None:
        """Advance by a control step.

        Args:
            paddles: positions (paddles, 2), m, and velocities, m/s; changed in place.
            command: velocity at the end of the step (paddles, 2), m/s; True if the
                paddle moves at it during all of the step and does not yield (paddles,);
                True if it touches nothing (paddles,).
            path: (substeps + 1, movers, 4), filled; or None.
        """
        (position, velocity), (goal, imposed, lifted) = paddles, command
        mean, size = np.zeros(goal.shape), 2 * self.scene.table.paddle_radius
        seats = self.scene.bodies.paddle
        self._begin()
        self._lift(lifted)
        if path is not None:
            self.read(path[0])
        for k in range(self.substeps):
            self._substep, left = k, self.substeps - k
            motion = position, velocity, goal, imposed, lifted, left, self.dt, size
            overlap = ramp_paddles(*motion, mean)
            for i, body in enumerate(self.bodies.all[seats]):
                body.velocity = tuple(mean[i].tolist())
                if overlap:
                    body.position = tuple((position[i] - mean[i] * self.dt).tolist())
            self.space.step(self.dt)
            if self._contact:
                self._settle()
            if path is not None:
                self.read(path[k + 1])
        self._initial_contacts.clear()
        self._lift(np.zeros_like(lifted))

    def read(self, rows: Array) -> None:
        """Fill ``rows`` (movers, 4) with x, y, vx, vy of every body."""
        pucks = self.scene.bodies.puck
        for i, body in enumerate(self.bodies.all):
            rows[i, :2], rows[i, 2:] = body.position, body.velocity
        rows[pucks, 2] += self.leapfrog_offset
        for k, place in self._out.items():
            rows[pucks.start + k] = (*place, 0.0, 0.0)

    def read_angles(self, angle: Array, spin: Array) -> None:
        """Fill angle (N,), rad, and spin (N,), rad/s, of the blocks."""
        for i in range(self.scene.bodies.block.start, self.scene.bodies.block.stop):
            body = self.bodies.all[i]
            angle[i], spin[i] = body.angle, body.angular_velocity

    def close_goals(self, closed: Array) -> None:
        """Close the goal lines that ``closed`` (M,) marks and open the others."""
        for index, plug in self._walls.plugs.items():
            line = self.scene.goal_lines[index]
            self._sides[line.side, 5] = 0.0 if closed[index] else (line.width or 0) / 2
            plug.filter = EVERYTHING if closed[index] else NOTHING

    def _begin(self) -> None:
        """Clear the events of the last step."""
        self.touched[:], self.touched_at[:] = 0, np.nan
        self.banked[:], self.crossed[:], self.crossed_velocity[:] = 0, False, 0.0
        for k in self._out:
            self._park(k)
        self._contact = bool(self._out) or bool(self.touching.any())

    def _lift(self, lifted: Array) -> None:
        """Disable contacts of the paddles that ``lifted`` (paddles,) marks."""
        for shape, up in zip(self.bodies.shapes, lifted.tolist(), strict=False):
            wanted = NOTHING if up else EVERYTHING
            if shape.filter != wanted:
                shape.filter = wanted

    def _touch(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        pair = self._pair(arbiter, PADDLE)
        self._contact = True
        if self.touching[pair]:
            return
        self.touched[pair] += 1
        self.touched_at[pair] = (self._substep + 1) * self.dt
        self.touching[pair] = True

    def _part(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        self.touching[self._pair(arbiter, PADDLE)] = False

    def _cross(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        puck, shape = self._ordered(arbiter, PUCK)
        k, index = self.bodies.index[puck], self._walls.goal_line[shape]
        if k in self._out or not self._bounces(k, shape):
            return
        self._contact = True
        body = self.bodies.all[self.scene.bodies.puck.start + k]
        velocity = body.velocity.x + self.leapfrog_offset, body.velocity.y
        self.crossed[k, index], self.crossed_velocity[k, index] = True, velocity
        if self.scene.goal_lines[index].width is not None:
            self._out[k] = tuple(body.position)

    def _bank(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        puck, shape = self._ordered(arbiter, PUCK)
        self._bounces(self.bodies.index[puck], shape)

    def _bounces(self, k: int, shape: pymunk.Shape) -> bool:
        """Count a bounce of puck k; return False for a contact since the reset."""
        side = self._walls.side.get(shape)
        if side is None:
            return True
        if (k, side) in self._initial_contacts:
            return False
        self.banked[k, side] += 1
        return True

    def _soften(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Set the lower of both restitutions; Chipmunk's product is for pucks only."""
        a, b = arbiter.shapes
        arbiter.restitution = min(a.elasticity, b.elasticity)

    @staticmethod
    def _ordered(
        arbiter: pymunk.Arbiter, kind: int
    ) -> tuple[pymunk.Shape, pymunk.Shape]:
        """Return the shape of a kind, then the other; Chipmunk may swap them."""
        a, b = arbiter.shapes
        return (a, b) if a.collision_type == kind else (b, a)

    def _pair(self, arbiter: pymunk.Arbiter, kind: int) -> tuple[int, int]:
        a, b = self._ordered(arbiter, kind)
        return self.bodies.index[a], self.bodies.index[b]

    def _settle(self) -> None:
        """Correct pucks after a contact: out of walls, below the cap, parked if out."""
        bodies, table, offset = (
            self.scene.bodies,
            self.scene.table,
            self.leapfrog_offset,
        )
        radius = table.puck_radius
        for k, puck in enumerate(self.bodies.all[bodies.puck]):
            if k in self._out:
                self._park(k)
                continue
            vx, vy = puck.velocity.x + offset, puck.velocity.y
            square = vx * vx + vy * vy
            if square > PUCK_SPEED_CAP**2:
                share = PUCK_SPEED_CAP / square**0.5
                puck.velocity = vx * share - offset, vy * share
            x, y = puck.position
            if wall(self._sides, radius, x, y, SQUEEZE) < 0:
                continue
            paddles = np.array([p.position for p in self.bodies.all[bodies.paddle]])
            touch = radius + table.paddle_radius
            puck.position = slide_out(self._sides, radius, x, y, paddles, touch)

    def _park(self, k: int) -> None:
        body = self.bodies.all[self.scene.bodies.puck.start + k]
        body.position, body.velocity = (POCKET * (1 + k), POCKET), (0.0, 0.0)
