"""World of the pymunk backend: a space with paddles, pucks, blocks, walls and goals.

Within a step, velocities are half a substep ahead of positions (leapfrog). The error of
a puck's free flight is therefore of third order.
"""

from __future__ import annotations

import numpy as np
import pymunk

from marl_airhockey.sim.backends._planar.overlaps import give_way
from marl_airhockey.sim.backends._planar.paddles import keep_in_reach, ramp_paddles
from marl_airhockey.sim.backends._planar.walls import depth_in_side, sides
from marl_airhockey.sim.backends.pymunk.building import (
    BLOCK,
    EVERYTHING,
    GOAL_LINE,
    NOTHING,
    PADDLE,
    PUCK,
    WALL,
    SpaceBodies,
    SpaceWalls,
)
from marl_airhockey.sim.contracts.backend import PATIENCE
from marl_airhockey.sim.core.laws import cap, fly, wall_restitution
from marl_airhockey.sim.core.parameters import PARAMETERS, PUCK_SPEED_CAP, SCATTER
from marl_airhockey.sim.core.scatter import at_paddle, at_wall, draw
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import reaches
from marl_airhockey.sim.core.table import GRAVITY
from marl_airhockey.types import Array

POCKET = 100.0
"""Coordinate of pucks out of play, far from the table, m."""
ARM = 0.765
"""Mean distance of a square's points from its centre, per half of its side."""


class Space:
    """Space: one world in Chipmunk.

    Args:
        scene: Scene of the world.
        control_dt: Length of a control step, s.
        substeps: Number of physics steps in a control step.
    """

    def __init__(self, scene: Scene, control_dt: float, substeps: int) -> None:
        self.scene, self.substeps, self.control_dt = scene, substeps, control_dt
        self.dt = control_dt / substeps
        self.space = space = pymunk.Space()
        # Overlap is removed immediately; resting contacts keep 0.1 mm.
        space.collision_slop, space.collision_bias = 1e-4, 0.0
        bodies, lines = scene.bodies, len(scene.goal_lines)
        pairs, table_sides = (bodies.paddles, bodies.pucks), len(scene.table.vertices)
        self.touched = np.zeros(pairs, np.int64)
        self.touched_at = np.full(pairs, np.nan)
        self.touching = np.zeros(pairs, np.bool_)
        self.banked = np.zeros((bodies.pucks, table_sides), np.int64)
        self.crossed = np.zeros((bodies.pucks, lines), np.bool_)
        self.crossed_velocity = np.zeros((bodies.pucks, lines, 2))
        self.lifted = np.zeros(bodies.pucks, np.bool_)
        self._pinned = np.zeros(bodies.pucks)
        self.bodies, self._walls = SpaceBodies(space, scene), SpaceWalls(space, scene)
        self._sides, self._elapsed = sides(scene), 0.0
        keeps = scene.table.puck_radius
        rows = [
            (*o.start, *(o.end or o.start), o.radius + keeps) for o in scene.obstacles
        ]
        self._posts = np.array(rows, float).reshape(-1, 5)
        self._radius = np.array(bodies.radius)[: bodies.paddles + bodies.pucks]
        self._reach = reaches(scene.table, scene.seats)
        self._held = np.zeros(bodies.paddles, np.bool_)
        """True for paddles that began the step in the workspace, which limits them."""
        self._out: dict[int, tuple[float, float]] = {}
        """Positions at which pucks left play, by puck, table frame, m."""
        self._initial_contacts: set[tuple[int, int]] = set()
        """Pairs of puck and side in contact at a reset, which are not bounces."""
        self._key, self._collisions, self._scatters = np.uint64(0), 0, False
        self._kicks: dict[tuple[pymunk.Shape, ...], float] = {}
        """Contact noise of contacts that begin, by shapes, see `core.scatter`."""
        self._contact = False
        """True if a paddle touches a puck, or if a puck has crossed a goal line."""
        at_paddle = {"begin": self._touch, "separate": self._part}
        for kind, other, begin in (
            (PADDLE, PUCK, at_paddle),
            (PUCK, GOAL_LINE, {"begin": self._cross}),
            (PUCK, WALL, {"begin": self._bank}),
        ):
            solve = self._hit if kind == PADDLE else self._bounce
            space.on_collision(
                kind, other, **begin, pre_solve=solve, post_solve=self._kick
            )
        space.on_collision(PUCK, PUCK, pre_solve=self._meet)
        for kind in (PADDLE, WALL, GOAL_LINE, BLOCK, PUCK):
            space.on_collision(BLOCK, kind, pre_solve=self._shove)
        for body in self.bodies.all[bodies.puck]:
            body.velocity_func = self._glide
        self.set_physics({name: p.default for name, p in PARAMETERS.items()})

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the physical parameters by name."""
        self._values = values
        self._scatters = any(values[name] > 0.0 for name in SCATTER)
        angles = np.radians([values["tilt"], values["cross_tilt"]])
        self._pull = (
            -float(GRAVITY * np.sin(angles[0])),
            -float(GRAVITY * np.sin(angles[1])),
        )
        self.space.gravity = self._pull
        self._drag = values["puck_damping"], values["puck_drag"]
        bodies, half = self.scene.bodies, self.scene.block_radius
        mass, radius = values["puck_mass"], self.scene.table.puck_radius
        for body in self.bodies.all[bodies.puck]:
            body.mass, body.moment = mass, 0.5 * mass * radius**2
        mass, friction = values["block_mass"], values["block_friction"]
        for i, body in enumerate(self.bodies.all[bodies.block]):
            body.mass = mass
            self.bodies.friction_joints[2 * i].max_force = mass * friction
            self.bodies.friction_joints[2 * i + 1].max_force = (
                mass * friction * ARM * half
            )
            if self.scene.block_shape == "square":
                body.moment = mass * (2 * half) ** 2 / 6

    def key_scatter(self, key: np.uint64) -> None:
        """Set the key of the contact noise and the number of collisions to 0."""
        self._key, self._collisions = key, 0

    def reset(
        self,
        position: Array,
        velocity: Array,
        angle: Array,
        spin: Array,
        touching: Array,
    ) -> None:
        """Place all bodies and set the contacts that already exist.

        Shapes are removed and added in order, which clears the contact caches of
        Chipmunk. Equal initial states therefore lead to equal episodes.

        Args:
            position: Positions (N, 2), table frame, m.
            velocity: Velocities (N, 2), table frame, m/s.
            angle: Orientations (N,), rad.
            spin: Angular velocities (N,), rad/s.
            touching: True for paddles and pucks in contact (paddles, pucks).
        """
        self.space.remove(*self.bodies.shapes)
        self.space.add(*self.bodies.shapes)
        pucks = self.scene.bodies.puck
        for i, body in enumerate(self.bodies.all):
            x, y = position[i].tolist()
            body.position, body.velocity = (x, y), tuple(velocity[i].tolist())
            if i >= pucks.start:
                body.angle, body.angular_velocity = float(angle[i]), float(spin[i])
            self.space.reindex_shapes_for_body(body)
        self._out.clear()
        self._pinned[:] = 0.0
        self.touching[:] = touching
        radius = self.scene.table.puck_radius
        self._contact = True
        self._initial_contacts = {
            (k, side)
            for k, (x, y) in enumerate(position[pucks].tolist())
            for side in range(len(self._sides))
            if depth_in_side(self._sides, side, radius, x, y) > 0.0
        }

    def step(
        self,
        paddles: tuple[Array, Array],
        command: tuple[Array, Array, Array],
        path: Array | None,
    ) -> None:
        """Advance by a control step.

        Args:
            paddles: Positions (paddles, 2), m, and velocities (paddles, 2), m/s, of the
                paddles, table frame, changed in place.
            command: Three arrays: velocities at the end of the step (paddles, 2), m/s;
                True for paddles that have this velocity during the whole step and do
                not yield (paddles,); True for paddles that touch nothing (paddles,).
            path: Path (substeps + 1, movers, 4), filled; None if it is not requested.
        """
        (position, velocity), (goal, imposed, raised) = paddles, command
        mean, size = np.zeros(goal.shape), 2 * self.scene.table.paddle_radius
        seats = self.scene.bodies.paddle
        normals, offsets = self._reach
        inside = (normals * position[:, None]).sum(-1) + offsets > -1e-9
        self._held = inside.all(-1) & ~imposed
        count = self._count(velocity, goal)
        self.dt, every = self.control_dt / count, count // self.substeps
        self._begin()
        self._raise(raised)
        if path is not None:
            self.read(path[0], velocity)
        self._leap(0.5 * self.dt)
        for k in range(count):
            self._elapsed, left = (k + 1) * self.dt, count - k
            motion = position, velocity, goal, imposed, raised, left, self.dt, size
            overlap = ramp_paddles(*motion, mean)
            overlap |= keep_in_reach(position, velocity, self._held, *self._reach)
            for i, body in enumerate(self.bodies.all[seats]):
                body.velocity = tuple(mean[i].tolist())
                if overlap:
                    body.position = tuple((position[i] - mean[i] * self.dt).tolist())
            self.space.step(self.dt)
            if self._contact:
                self._settle(position, velocity, imposed, raised)
            if path is not None and (k + 1) % every == 0:
                self._leap(-0.5 * self.dt)
                self.read(path[(k + 1) // every], velocity)
                self._leap(0.5 * self.dt)
        self._leap(-0.5 * self.dt)
        self._keep_below_the_cap()
        self._initial_contacts.clear()
        self._raise(np.zeros_like(raised))
        self._lift_pinned(position, imposed, raised)

    def _count(self, velocity: Array, goal: Array) -> int:
        """Return the number of substeps in which no body moves too far.

        A hit increases the speed of a puck by at most twice the speed of the paddle.
        """
        pucks = self.bodies.all[self.scene.bodies.puck]
        fastest = max((puck.velocity.length for puck in pucks), default=0.0)
        paddle = float(max(np.hypot(*velocity.T).max(), np.hypot(*goal.T).max()))
        most = min(fastest + 2 * paddle, max(PUCK_SPEED_CAP, paddle))
        way = most * self.control_dt / (self.scene.table.puck_radius / 3)
        return self.substeps * max(int(np.ceil(way / self.substeps)), 1)

    def _leap(self, time: float) -> None:
        """Advance the velocities of pucks by a time in free flight, s."""
        for k, body in enumerate(self.bodies.all[self.scene.bodies.puck]):
            if k not in self._out:
                v = body.velocity
                _, _, vx, vy = fly(v.x, v.y, time, *self._pull, *self._drag)
                body.velocity = vx, vy

    def _glide(
        self, body: pymunk.Body, gravity: object, damping: float, dt: float
    ) -> None:
        """Advance the velocity of a puck as in free flight; keep its spin."""
        v = body.velocity
        _, _, vx, vy = fly(v.x, v.y, dt, *self._pull, *self._drag)
        body.velocity = vx, vy

    def read(self, rows: Array, paddle_velocity: Array) -> None:
        """Fill ``rows`` (movers, 4) with x, y, vx, vy of every body."""
        for i, body in enumerate(self.bodies.all):
            rows[i, :2], rows[i, 2:] = body.position, body.velocity
        rows[: len(paddle_velocity), 2:] = paddle_velocity
        for k, place in self._out.items():
            rows[self.scene.bodies.puck.start + k] = (*place, 0.0, 0.0)

    def read_angles(self, angle: Array, spin: Array) -> None:
        """Fill angle (N,), rad, and spin (N,), rad/s, of pucks and blocks."""
        bodies = self.scene.bodies
        for i in range(bodies.puck.start, bodies.block.stop):
            body = self.bodies.all[i]
            angle[i], spin[i] = body.angle, body.angular_velocity
        for k in self._out:
            spin[bodies.puck.start + k] = 0.0

    def close_goals(self, closed: Array) -> None:
        """Close the goal lines with True in ``closed`` (M,) and open the others."""
        for index, plug in self._walls.plugs.items():
            line = self.scene.goal_lines[index]
            self._sides[line.side, 5] = 0.0 if closed[index] else (line.width or 0) / 2
            plug.filter = EVERYTHING if closed[index] else NOTHING

    def _begin(self) -> None:
        """Clear the events of the last step."""
        self.touched[:], self.touched_at[:] = 0, np.nan
        self.banked[:], self.crossed[:], self.crossed_velocity[:] = 0, False, 0.0
        self.lifted[:] = False
        for k in self._out:
            self._park(k)
        self._contact = bool(self._out) or bool(self.touching.any())

    def _raise(self, raised: Array) -> None:
        """Disable the contacts of paddles with True in ``raised`` (paddles,)."""
        for shape, up in zip(self.bodies.shapes, raised.tolist(), strict=False):
            wanted = NOTHING if up else EVERYTHING
            if shape.filter != wanted:
                shape.filter = wanted

    def _touch(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        pair = self._pair(arbiter, PADDLE)
        self._contact = True
        if self.touching[pair]:
            return
        self.touched[pair] += 1
        self.touched_at[pair] = self._elapsed
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
        self.crossed[k, index] = True
        self.crossed_velocity[k, index] = body.velocity
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

    def _hit(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Set the restitution and the friction of a puck at a paddle."""
        restitution = self._values["paddle_restitution"]
        if self._scatters and arbiter.is_first_contact:
            names = "paddle_restitution_scatter", "spin_scatter"
            sds = [self._values[name] for name in names]
            drawn = at_paddle(self._draw(), restitution, *sds)
            restitution, self._kicks[arbiter.shapes] = drawn
        arbiter.restitution = restitution
        arbiter.friction = self._values["paddle_friction"]

    def _draw(self) -> tuple[float, float, float]:
        """Sample the noise of the next collision."""
        self._collisions += 1
        return draw(self._key, self._collisions, 0)

    def _kick(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Add the noise of the first contact to the motion of a puck."""
        kick = self._kicks.pop(arbiter.shapes, 0.0)
        if kick == 0.0:
            return
        shape, other = self._ordered(arbiter, PUCK)
        body = shape.body
        assert body is not None
        if other.collision_type == PADDLE:
            speed = body.velocity.length / self.scene.table.puck_radius
            body.angular_velocity += kick * speed
        else:
            body.velocity += kick * arbiter.normal.perpendicular()

    def _meet(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Set the restitution and the friction of two pucks."""
        arbiter.restitution = self._values["puck_restitution"]
        arbiter.friction = self._values["puck_friction"]

    def _bounce(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Set the restitution and the friction of a puck at a wall."""
        restitution = self._at_wall(arbiter, PUCK)
        if self._scatters and arbiter.is_first_contact:
            names = "wall_restitution_scatter", "wall_exit_scatter"
            sds = [self._values[name] for name in names]
            speed = self._closing(arbiter, PUCK)
            drawn = at_wall(self._draw(), speed, restitution, *sds)
            restitution, self._kicks[arbiter.shapes] = drawn
        arbiter.restitution = restitution
        arbiter.friction = self._values["wall_friction"]

    def _shove(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Set the restitution and the friction of a block; a wall limits the former."""
        _block, other = self._ordered(arbiter, BLOCK)
        arbiter.restitution = self._values["block_restitution"]
        arbiter.friction = 0.0
        if other.collision_type == PUCK:
            arbiter.friction = self._values["puck_friction"]
        elif other.collision_type in (WALL, GOAL_LINE):
            wall = self._at_wall(arbiter, BLOCK)
            arbiter.restitution = min(arbiter.restitution, wall)

    def _at_wall(self, arbiter: pymunk.Arbiter, kind: int) -> float:
        """Return the restitution at a wall for the normal speed of the contact."""
        names = "wall_restitution", "wall_restitution_slope"
        values = (self._values[name] for name in names)
        return float(wall_restitution(self._closing(arbiter, kind), *values))

    def _closing(self, arbiter: pymunk.Arbiter, kind: int) -> float:
        """Return the speed of a body of a kind along the normal of a contact, m/s."""
        shape, _other = self._ordered(arbiter, kind)
        assert shape.body is not None
        return abs(shape.body.velocity.dot(arbiter.normal))

    @staticmethod
    def _ordered(
        arbiter: pymunk.Arbiter, kind: int
    ) -> tuple[pymunk.Shape, pymunk.Shape]:
        """Return the shape of a kind, then the other one; Chipmunk may swap them."""
        a, b = arbiter.shapes
        return (a, b) if a.collision_type == kind else (b, a)

    def _pair(self, arbiter: pymunk.Arbiter, kind: int) -> tuple[int, int]:
        a, b = self._ordered(arbiter, kind)
        return self.bodies.index[a], self.bodies.index[b]

    def _settle(
        self, position: Array, velocity: Array, imposed: Array, raised: Array
    ) -> None:
        """Limit speeds, separate bodies and remove pucks out of play after a contact.

        A paddle stops at a puck that it cannot push away. Its rows of ``position`` and
        ``velocity`` then change.
        """
        paddles = len(position)
        pucks = self.bodies.all[self.scene.bodies.puck]
        for k in self._out:
            self._park(k)
        self._keep_below_the_cap()
        places = np.array([*position, *(puck.position for puck in pucks)])
        absent = np.zeros(len(places), np.bool_)
        absent[:paddles] = raised
        absent[[paddles + k for k in self._out]] = True
        before = places.copy()
        what = self._radius, paddles, imposed, absent, self._sides, self._posts
        if not give_way(places, velocity, *what):
            return
        position[:] = places[:paddles]
        keep_in_reach(position, velocity, self._held, *self._reach)
        places[:paddles] = position
        for i in np.flatnonzero((places != before).any(-1)).tolist():
            body = self.bodies.all[i]
            body.position = float(places[i, 0]), float(places[i, 1])
            self.space.reindex_shapes_for_body(body)

    def _keep_below_the_cap(self) -> None:
        for puck in self.bodies.all[self.scene.bodies.puck]:
            share = cap(puck.velocity.x, puck.velocity.y)
            if share < 1.0:
                puck.velocity = puck.velocity * share

    def _lift_pinned(self, position: Array, imposed: Array, raised: Array) -> None:
        """Lift pucks that position-driven paddles have pinned for `PATIENCE`."""
        table = self.scene.table
        touch = table.paddle_radius + table.puck_radius - 1e-3
        for k, puck in enumerate(self.bodies.all[self.scene.bodies.puck]):
            if k in self._out or not imposed.any():
                self._pinned[k] = 0.0
                continue
            gap = np.hypot(*(position - np.array(puck.position)).T)
            held = bool((imposed & ~raised & (gap < touch)).any())
            self._pinned[k] = self._pinned[k] + self.control_dt if held else 0.0
            if self._pinned[k] > PATIENCE - 1e-9:
                self.lifted[k], self._out[k] = True, (puck.position.x, puck.position.y)
                self._park(k)

    def _park(self, k: int) -> None:
        body = self.bodies.all[self.scene.bodies.puck.start + k]
        body.position, body.velocity = (POCKET * (1 + k), POCKET), (0.0, 0.0)
