"""One world on pymunk: paddles, pucks, blocks, walls and goal lines in a space.

Velocities inside a space are those half a substep ahead (leapfrog), so that a falling
puck follows its parabola exactly; `kick` is what the backend adds when it reports them.
"""

from __future__ import annotations

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import lib

from marl_airhockey.backends._planar.paddles import drive
from marl_airhockey.backends._planar.walls import SQUEEZE, sides, slip, wall
from marl_airhockey.backends.pymunk.chipmunk import EVENT, SUBSTEP, Reader, address
from marl_airhockey.core.physics import PARAMETERS, PUCK_SPEED_CAP
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.table import GRAVITY
from marl_airhockey.types import Array

PADDLE, PUCK, WALL, GOAL_LINE, BLOCK = 1, 2, 3, 4, 5
"""Collision types."""
THICK = 0.5
"""m: a wall this thick is never passed between two substeps."""
NOTHING, EVERYTHING = pymunk.ShapeFilter(mask=0), pymunk.ShapeFilter()
"""What a shape can touch."""
POCKET = 100.0
"""m: pucks out of play wait here, far from everything."""


class Space:
    """One world: a pymunk space with paddles, pucks, blocks, walls and goal lines.

    Args:
        scene: who is on the table.
        control_dt: s.
        substeps: physics steps in a control step.
        flags: (2,) this world's row of `chipmunk.new_flags`.
    """

    def __init__(
        self, scene: Scene, control_dt: float, substeps: int, flags: Array
    ) -> None:
        self.scene, self.control_dt, self.substeps = scene, control_dt, substeps
        self.flags = flags
        self.sim_dt = control_dt / substeps
        self.space = space = pymunk.Space()
        # Overlap goes at once; contacts rest with a tenth of a millimetre of it.
        space.collision_slop, space.collision_bias = 1e-4, 0.0
        self._out: dict[int, tuple[float, float]] = {}
        bodies = scene.bodies
        pairs = (bodies.paddles, bodies.pucks)
        self.touched = np.zeros(pairs, np.int64)
        self.touched_at = np.full(pairs, np.nan)
        self.touching = np.zeros(pairs, np.bool_)
        self.crossed = np.zeros((bodies.pucks, len(scene.goal_lines)), np.bool_)
        self.crossed_velocity = np.zeros((*self.crossed.shape, 2))
        self._shapes: dict[pymunk.Shape, int] = {}
        self._sides = sides(scene)
        self._build_bodies()
        self._build_walls()
        space.on_collision(PADDLE, PUCK, begin=self._touch, separate=self._part)
        space.on_collision(PUCK, GOAL_LINE, begin=self._cross)
        for kind in (PADDLE, WALL, GOAL_LINE, BLOCK):
            space.on_collision(BLOCK, kind, pre_solve=self._soften)
        self._read = Reader(space, len(self.bodies))
        self._space = space._space
        self._raw = [body._body for body in self.bodies]
        self._hands = self._raw[bodies.paddle]
        self._mean = np.zeros((bodies.paddles, 2))
        self._loose = [s._shape for body in self.bodies for s in body.shapes]
        self.set_physics({name: p.default for name, p in PARAMETERS.items()})

    def _build_bodies(self) -> None:
        scene, space = self.scene, self.space
        self.bodies: list[pymunk.Body] = []
        self.paddles: list[pymunk.Shape] = []
        self.blocks: list[pymunk.Shape] = []
        self._grips: list[pymunk.Constraint] = []
        for i in range(len(scene.seats)):
            body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            disc = pymunk.Circle(body, scene.table.paddle_radius)
            self.paddles.append(self._add(body, disc, PADDLE, i))
        for i in range(scene.pucks):
            body = pymunk.Body(1.0, float("inf"))
            disc = pymunk.Circle(body, scene.table.puck_radius)
            self._add(body, disc, PUCK, i).elasticity = 1.0
        for i in range(scene.blocks):
            body = pymunk.Body(1.0, float("inf"))
            size = 2 * scene.block_radius
            shape: pymunk.Shape
            if scene.block_shape == "disc":
                shape = pymunk.Circle(body, scene.block_radius)
            else:
                shape = pymunk.Poly.create_box(body, (size, size))
            self.blocks.append(self._add(body, shape, BLOCK, i))
            # Coulomb friction on the table: joints that hold up to a largest force.
            grip = pymunk.PivotJoint(space.static_body, body, (0, 0), (0, 0))
            twist = pymunk.GearJoint(space.static_body, body, 0.0, 1.0)
            for joint in (grip, twist):
                joint.max_bias = 0.0
                space.add(joint)
                self._grips.append(joint)

    def _add(
        self, body: pymunk.Body, shape: pymunk.Shape, kind: int, index: int
    ) -> pymunk.Shape:
        shape.collision_type, shape.friction = kind, 0.0
        self.space.add(body, shape)
        self.bodies.append(body)
        self._shapes[shape] = index
        return shape

    def _build_walls(self) -> None:
        """Boxes behind every side, with a gap and a sensor in it for a goal line."""
        scene, static = self.scene, self.space.static_body
        self.walls: list[pymunk.Shape] = []
        self._plugs: dict[int, pymunk.Shape] = {}
        for side in range(len(scene.table.vertices)):
            start, end = scene.table.ends(side)
            along = (end - start) / np.linalg.norm(end - start)
            out = -scene.table.normals[side] * THICK
            goal_lines = [m for m in scene.goal_lines if m.side == side]
            gaps = [m for m in goal_lines if m.width is not None]
            cuts = [start - along * THICK]
            for goal_line in gaps:
                middle, half = (start + end) / 2, along * (goal_line.width or 0.0) / 2
                cuts += [middle - half, middle + half]
                # The sensor begins a radius behind the line: the centre has passed.
                depth = out / THICK * scene.table.puck_radius
                box = [middle - half + depth, middle + half + depth]
                sensor = self._box(static, box[0], box[1], out)
                sensor.sensor, sensor.collision_type = True, GOAL_LINE
                self._shapes[sensor] = scene.goal_lines.index(goal_line)
                self.space.add(sensor)
                plug = self._box(static, middle - half, middle + half, out)
                plug.collision_type, plug.filter = WALL, NOTHING
                self._plugs[scene.goal_lines.index(goal_line)] = plug
                self.walls.append(plug)
                self.space.add(plug)
            cuts.append(end + along * THICK)
            for a, b in zip(cuts[::2], cuts[1::2], strict=True):
                wall = self._box(static, a, b, out)
                wall.collision_type = WALL
                for goal_line in goal_lines:
                    if goal_line.width is None:
                        wall.collision_type = GOAL_LINE
                        self._shapes[wall] = scene.goal_lines.index(goal_line)
                self.walls.append(wall)
                self.space.add(wall)
        for obstacle in scene.obstacles:
            tip = obstacle.end or obstacle.start
            shape = pymunk.Segment(static, obstacle.start, tip, obstacle.radius)
            shape.friction, shape.collision_type = 0.0, WALL
            self.walls.append(shape)
            self.space.add(shape)

    @staticmethod
    def _box(static: pymunk.Body, a: Array, b: Array, out: Array) -> pymunk.Poly:
        corners = [(float(x), float(y)) for x, y in (a, b, b + out, a + out)]
        box = pymunk.Poly(static, corners)
        box.friction = 0.0
        return box

    def read(self) -> Array:
        """(movers, 4) x, y, vx, vy of every body; the same memory at every call."""
        return self._read()

    def _touch(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        pair = self._pair(arbiter, PADDLE)
        self.touched[pair] += 1
        self.touched_at[pair] = (self.flags[SUBSTEP] + 1) * self.sim_dt
        self.touching[pair] = True
        self.flags[EVENT] = 1

    def _part(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        self.touching[self._pair(arbiter, PADDLE)] = False

    def _pair(self, arbiter: pymunk.Arbiter, kind: int) -> tuple[int, int]:
        """Indices of the shape of a kind and of the other: in any order of Chipmunk's.

        When shapes are taken off, it may swap them.
        """
        a, b = arbiter.shapes
        if a.collision_type != kind:
            a, b = b, a
        return self._shapes[a], self._shapes[b]

    def _soften(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        """Chipmunk takes the product of two restitutions, which is right for pucks."""
        a, b = arbiter.shapes
        arbiter.restitution = min(a.elasticity, b.elasticity)

    def _cross(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        pair = self._pair(arbiter, PUCK)
        body = self.bodies[self.scene.bodies.puck.start + pair[0]]
        if pair[0] in self._out:
            return
        self.crossed[pair] = True
        self.crossed_velocity[pair] = body.velocity
        self.flags[EVENT] = 1
        if self.scene.goal_lines[pair[1]].width is not None:
            self._out[pair[0]] = body.position

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the parameters of this world, by name."""
        pull = GRAVITY * np.sin(np.radians(values["tilt"]))
        self.space.gravity = (-float(pull), 0.0)
        self.space.damping = float(np.exp(-values["puck_damping"]))
        self.kick = 0.5 * self.sim_dt * float(pull)
        for shape in self.walls:
            shape.elasticity = values["wall_restitution"]
        for paddle in self.paddles:
            paddle.elasticity = values["paddle_restitution"]
        for body in self.bodies[self.scene.bodies.puck]:
            body.mass = values["puck_mass"]
        mass, grip = values["block_mass"], values["block_friction"]
        half = self.scene.block_radius
        bodies = self.bodies[self.scene.bodies.block]
        for i, (body, shape) in enumerate(zip(bodies, self.blocks, strict=True)):
            shape.elasticity = values["block_restitution"]
            body.mass = mass
            self._grips[2 * i].max_force = mass * grip
            # The mean distance of a square's points from its centre is 0.765 halves.
            self._grips[2 * i + 1].max_force = mass * grip * 0.765 * half
            if self.scene.block_shape == "square":
                body.moment = mass * (2 * half) ** 2 / 6

    def start(self, position: Array, velocity: Array, angle: Array) -> None:
        """Put every mover (movers, 2) at a place with a velocity; forget all contacts.

        Shapes are added anew in their order, so that no contact of the last episode
        lives on in Chipmunk's caches and the same start gives the same episode.
        """
        # Through the library, as pymunk's bookkeeping of what is added stays the same.
        for shape in self._loose:
            lib.cpSpaceRemoveShape(self._space, shape)
        for shape in self._loose:
            lib.cpSpaceAddShape(self._space, shape)
        pucks = self.scene.bodies.puck
        for i, body in enumerate(self.bodies):
            x, y = position[i].tolist()
            vx, vy = velocity[i].tolist()
            body.position = (x, y)
            body.velocity = (vx - self.kick * (pucks.start <= i < pucks.stop), vy)
            if i >= pucks.stop:
                body.angle, body.angular_velocity = float(angle[i]), 0.0
            lib.cpSpaceReindexShapesForBody(self._space, body._body)
        self._out.clear()
        self.touching[:] = False
        self.flags[EVENT] = 1

    def step(
        self,
        position: Array,
        velocity: Array,
        goal: Array,
        prescribed: Array,
        lifted: Array,
        path: Array | None,
    ) -> None:
        """Move by ``control_dt``, or by what `chipmunk.drift` has left of it.

        Args:
            position: (paddles, 2) by now, m; changed in place.
            velocity: (paddles, 2) by now, m/s; changed in place.
            goal: (paddles, 2) velocity at the end of the step, m/s.
            prescribed: (paddles,) bool: moves at ``goal`` all the time and does not yield.
            lifted: (paddles,) bool: touches nothing.
            path: (substeps + 1, movers, 4) to be filled, or None.
        """
        n, flags, first = self.substeps, self.flags, int(self.flags[SUBSTEP]) + 1
        dt, size, mean = self.sim_dt, 2 * self.scene.table.paddle_radius, self._mean
        if first:
            self._settle()
        if path is not None:
            path[first] = self.read()
        for k in range(first, n):
            flags[SUBSTEP] = k
            met = drive(
                position, velocity, goal, prescribed, lifted, n - k, dt, size, mean
            )
            for body, speed in zip(self._hands, mean.tolist(), strict=True):
                lib.cpBodySetVelocity(body, speed)
            if met:
                back = position - mean * dt
                for body, place in zip(self._hands, back.tolist(), strict=True):
                    lib.cpBodySetPosition(body, place)
            lib.cpSpaceStep(self._space, dt)
            if flags[EVENT]:
                self._settle()
            if path is not None:
                path[k + 1] = self.read()

    def begin(self) -> None:
        """Forget the events of the last step."""
        self.touched[:] = 0
        self.touched_at[:] = np.nan
        self.crossed[:] = False
        for k in self._out:
            self._park(k)
        self.flags[EVENT] = bool(self._out) or bool(self.touching.any())

    def _settle(self) -> None:
        """After a contact: no puck in a wall, above the cap, or in a goal line in play."""
        first = self.scene.bodies.puck.start
        for k, body in enumerate(self._raw[self.scene.bodies.puck]):
            if k in self._out:
                self._park(k)
                continue
            v = lib.cpBodyGetVelocity(body)
            vx, vy = v.x + self.kick, v.y
            speed2 = vx * vx + vy * vy
            if speed2 > PUCK_SPEED_CAP**2:
                share = PUCK_SPEED_CAP / speed2**0.5
                lib.cpBodySetVelocity(body, (vx * share - self.kick, vy * share))
            puck = self.bodies[first + k]
            (x, y), table = puck.position, self.scene.table
            if wall(self._sides, table.puck_radius, x, y, SQUEEZE) < 0:
                continue
            paddles = self.bodies[self.scene.bodies.paddle]
            hands = np.array([paddle.position for paddle in paddles])
            radius = table.puck_radius
            free = slip(self._sides, radius, x, y, hands, radius + table.paddle_radius)
            puck.position = free

    def _park(self, puck: int) -> None:
        body = self._raw[self.scene.bodies.puck.start + puck]
        lib.cpBodySetPosition(body, (POCKET * (1 + puck), POCKET))
        lib.cpBodySetVelocity(body, (0.0, 0.0))

    def lift(self, paddle: int, up: bool) -> None:
        """Take a paddle off the table, or put it back: a lifted one touches nothing."""
        self.paddles[paddle].filter = NOTHING if up else EVERYTHING

    def closed(self, goal_lines: Array) -> None:
        """Make goal lines (M,) bool wall, and open the others again."""
        for goal_line, plug in self._plugs.items():
            plug.filter = EVERYTHING if goal_lines[goal_line] else NOTHING
            side = self.scene.goal_lines[goal_line].side
            half = (self.scene.goal_lines[goal_line].width or 0.0) / 2
            self._sides[side, 5] = 0.0 if goal_lines[goal_line] else half

    @property
    def addresses(self) -> tuple[int, ...]:
        """What `chipmunk.drift` needs: the space, its reader, the paddles."""
        hands = [address(body) for body in self._hands]
        return address(self._space), *self._read.addresses, *hands

    @property
    def out(self) -> dict[int, tuple[float, float]]:
        """Pucks out of play and where they went, m."""
        return self._out
