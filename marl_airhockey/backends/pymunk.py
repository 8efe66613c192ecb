"""The 2D table on pymunk (Chipmunk): B spaces stepped in a loop.

Velocities inside a space are those half a substep ahead (leapfrog), so that a falling
puck follows its parabola exactly; states report them at their own time.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pymunk
import pymunk.batch
from pymunk._chipmunk_cffi import ffi, lib

from marl_airhockey.backend import TOLD_SPEED, Backend, Command
from marl_airhockey.cast import Cast
from marl_airhockey.chipmunk import (
    AVAILABLE,
    EVENT,
    SUBSTEP,
    address,
    drift,
    new_flags,
)
from marl_airhockey.paddles import meet
from marl_airhockey.physics import PARAMETERS, PUCK_SPEED_CAP
from marl_airhockey.state import Array, State, still_state
from marl_airhockey.table import GRAVITY

PADDLE, PUCK, WALL, MOUTH, BLOCK = 1, 2, 3, 4, 5
"""Collision types."""
THICK = 0.5
"""m: a wall this thick is never passed between two substeps."""
SQUEEZE = 0.002
"""m: a puck that a paddle pushes deeper than this into a wall is set free."""
POCKET = 100.0
"""m: pucks out of play wait here, far from everything."""


class Space:
    """One world: a pymunk space with paddles, pucks, blocks, walls and mouths.

    Args:
        cast: who is on the table.
        control_dt: s.
        substeps: physics steps in a control step.
        flags: (2,) this world's row of `chipmunk.new_flags`.
    """

    def __init__(
        self, cast: Cast, control_dt: float, substeps: int, flags: Array
    ) -> None:
        self.cast, self.control_dt, self.substeps = cast, control_dt, substeps
        self.flags = flags
        self.sim_dt = control_dt / substeps
        self.space = space = pymunk.Space()
        # Overlap goes at once; contacts rest with a tenth of a millimetre of it.
        space.collision_slop, space.collision_bias = 1e-4, 0.0
        self._out: dict[int, tuple[float, float]] = {}
        bodies = cast.bodies
        pairs = (bodies.paddles, bodies.pucks)
        self.touched = np.zeros(pairs, np.int64)
        self.touched_at = np.full(pairs, np.nan)
        self.touching = np.zeros(pairs, np.bool_)
        self.crossed = np.zeros((bodies.pucks, len(cast.mouths)), np.bool_)
        self.crossed_velocity = np.zeros((*self.crossed.shape, 2))
        self._shapes: dict[pymunk.Shape, int] = {}
        self._build_bodies()
        self._build_walls()
        space.on_collision(PADDLE, PUCK, begin=self._touch, separate=self._part)
        space.on_collision(PUCK, MOUTH, begin=self._cross)
        self._open_buffer()
        self.set_physics({name: p.default for name, p in PARAMETERS.items()})

    def _build_bodies(self) -> None:
        cast, space = self.cast, self.space
        self.bodies: list[pymunk.Body] = []
        self.paddles: list[pymunk.Shape] = []
        self.blocks: list[pymunk.Shape] = []
        self._grips: list[pymunk.Constraint] = []
        for i in range(len(cast.seats)):
            body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            disc = pymunk.Circle(body, cast.table.paddle_radius)
            self.paddles.append(self._add(body, disc, PADDLE, i))
        for i in range(cast.pucks):
            body = pymunk.Body(1.0, float("inf"))
            disc = pymunk.Circle(body, cast.table.puck_radius)
            self._add(body, disc, PUCK, i).elasticity = 1.0
        for i in range(cast.blocks):
            body = pymunk.Body(1.0, float("inf"))
            size = 2 * cast.block_radius
            shape: pymunk.Shape
            if cast.block_shape == "disc":
                shape = pymunk.Circle(body, cast.block_radius)
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
        """Boxes behind every side, with a gap and a sensor in it for a goal mouth."""
        cast, static = self.cast, self.space.static_body
        self._lines: list[tuple[float, ...]] = []
        self.walls: list[pymunk.Shape] = []
        for side in range(len(cast.table.vertices)):
            start, end = cast.table.ends(side)
            along = (end - start) / np.linalg.norm(end - start)
            out = -cast.table.normals[side] * THICK
            mouths = [m for m in cast.mouths if m.side == side]
            gaps = [m for m in mouths if m.width is not None]
            cuts = [start - along * THICK]
            for mouth in gaps:
                middle, half = (start + end) / 2, along * (mouth.width or 0.0) / 2
                cuts += [middle - half, middle + half]
                # The sensor begins a radius behind the line: the centre has passed.
                depth = out / THICK * cast.table.puck_radius
                box = [middle - half + depth, middle + half + depth]
                sensor = self._box(static, box[0], box[1], out)
                sensor.sensor, sensor.collision_type = True, MOUTH
                self._shapes[sensor] = cast.mouths.index(mouth)
                self.space.add(sensor)
            cuts.append(end + along * THICK)
            line = float(cast.table.offsets[side]) - cast.table.puck_radius
            half = max([(m.width or 0.0) / 2 for m in gaps], default=0.0)
            middle = (start + end) / 2
            nx, ny = cast.table.normals[side].tolist()
            self._lines.append((nx, ny, line, *middle.tolist(), half))
            for a, b in zip(cuts[::2], cuts[1::2], strict=True):
                wall = self._box(static, a, b, out)
                wall.collision_type = WALL
                for mouth in mouths:
                    if mouth.width is None:
                        wall.collision_type = MOUTH
                        self._shapes[wall] = cast.mouths.index(mouth)
                self.walls.append(wall)
                self.space.add(wall)
        for obstacle in cast.obstacles:
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

    def _open_buffer(self) -> None:
        """Keep one buffer that Chipmunk fills with all bodies, in the order added."""
        # Kept beside pymunk's public call, which builds a struct at every read.
        fields = pymunk.batch.BodyFields
        wanted = fields.POSITION | fields.VELOCITY
        self._buffer = pymunk.batch.Buffer()
        pymunk.batch.get_space_bodies(self.space, wanted, self._buffer)
        self._data = ffi.new("pmBatchedData *")
        self._data.fields = wanted.value
        self._data.floatArray = self._buffer._float_arr
        self._data.intArray = self._buffer._int_arr
        self._each = ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")
        flat = np.frombuffer(self._buffer.float_buf(), dtype=np.float64)
        self.rows = flat.reshape(-1, 4)[: len(self.bodies)]
        self._raw = [body._body for body in self.bodies]
        self._loose = [s._shape for body in self.bodies for s in body.shapes]
        self._space = self.space._space

    def read(self) -> Array:
        """(movers, 4) x, y, vx, vy of every body; the same memory at every call."""
        self._buffer._float_arr.num = 0
        lib.cpSpaceEachBody(self._space, self._each, self._data)
        return self.rows

    def _touch(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        paddle, puck = arbiter.shapes
        pair = self._shapes[paddle], self._shapes[puck]
        self.touched[pair] += 1
        self.touched_at[pair] = (self.flags[SUBSTEP] + 1) * self.sim_dt
        self.touching[pair] = True
        self.flags[EVENT] = 1

    def _part(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        paddle, puck = arbiter.shapes
        self.touching[self._shapes[paddle], self._shapes[puck]] = False

    def _cross(self, arbiter: pymunk.Arbiter, *_: object) -> None:
        puck, mouth = arbiter.shapes
        pair = self._shapes[puck], self._shapes[mouth]
        body = self.bodies[self.cast.bodies.puck.start + pair[0]]
        if pair[0] in self._out:
            return
        self.crossed[pair] = True
        self.crossed_velocity[pair] = body.velocity
        self.flags[EVENT] = 1
        if mouth.sensor:
            self._out[pair[0]] = body.position

    def set_physics(self, values: dict[str, float]) -> None:
        """Set the parameters of this world, by name."""
        pull = GRAVITY * np.sin(np.radians(values["tilt"]))
        self.space.gravity = (-float(pull), 0.0)
        self.space.damping = float(np.exp(-values["puck_damping"]))
        self.kick = 0.5 * self.sim_dt * float(pull)
        for wall in self.walls:
            wall.elasticity = values["wall_restitution"]
        for paddle in self.paddles:
            paddle.elasticity = values["paddle_restitution"]
        for body in self.bodies[self.cast.bodies.puck]:
            body.mass = values["puck_mass"]
        mass, grip = values["block_mass"], values["block_friction"]
        half = self.cast.block_radius
        bodies = self.bodies[self.cast.bodies.block]
        for i, (body, shape) in enumerate(zip(bodies, self.blocks, strict=True)):
            shape.elasticity = values["block_restitution"]
            body.mass = mass
            self._grips[2 * i].max_force = mass * grip
            # The mean distance of a square's points from its centre is 0.765 halves.
            self._grips[2 * i + 1].max_force = mass * grip * 0.765 * half
            if self.cast.block_shape == "square":
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
        pucks = self.cast.bodies.puck
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
        told: Array,
        path: Array | None,
    ) -> None:
        """Move by ``control_dt``, or by what `chipmunk.drift` has left of it.

        Args:
            position: (paddles, 2) now, m; changed in place.
            velocity: (paddles, 2) now, m/s; changed in place.
            goal: (paddles, 2) velocity at the end of the step, m/s.
            told: (paddles,) bool: moves at ``goal`` all the time and does not yield.
            path: (substeps + 1, movers, 4) to be filled, or None.
        """
        n, flags, first = self.substeps, self.flags, int(self.flags[SUBSTEP]) + 1
        set_velocity, advance = lib.cpBodySetVelocity, lib.cpSpaceStep
        if path is not None:
            path[0] = self.read()
        velocity[told] = goal[told]
        ramp = (goal - velocity) / n
        alone = len(position) == 1
        (rx, ry), (x, y) = ramp[0].tolist(), (velocity[0] + 0.5 * ramp[0]).tolist()
        if first:
            self._settle()
        for k in range(first, n):
            flags[SUBSTEP] = k
            if alone:
                set_velocity(self._raw[0], (x + k * rx, y + k * ry))
            else:
                self._drive(position, velocity, ramp, told)
            advance(self._space, self.sim_dt)
            if flags[EVENT]:
                self._settle()
            if path is not None:
                path[k + 1] = self.read()
        if alone:
            velocity[0] = goal[0]

    def begin(self) -> None:
        """Forget the events of the last step."""
        self.touched[:] = 0
        self.touched_at[:] = np.nan
        self.crossed[:] = False
        for k in self._out:
            self._park(k)
        self.flags[EVENT] = bool(self._out) or bool(self.touching.any())

    def _drive(
        self, position: Array, velocity: Array, ramp: Array, told: Array
    ) -> None:
        """Move several paddles by a substep, letting them meet."""
        mean = velocity + 0.5 * ramp
        position += mean * self.sim_dt
        velocity += ramp
        met = meet(position, velocity, told, 2 * self.cast.table.paddle_radius)
        for i, body in enumerate(self._raw[: len(position)]):
            speed = velocity[i] if met else mean[i]
            lib.cpBodySetVelocity(body, tuple(speed.tolist()))
            if met:
                back = position[i] - speed * self.sim_dt
                lib.cpBodySetPosition(body, tuple(back.tolist()))

    def _settle(self) -> None:
        """After a contact: no puck in a wall, above the cap, or in a mouth in play."""
        first = self.cast.bodies.puck.start
        for k, body in enumerate(self._raw[self.cast.bodies.puck]):
            if k in self._out:
                self._park(k)
                continue
            v = lib.cpBodyGetVelocity(body)
            vx, vy = v.x + self.kick, v.y
            speed2 = vx * vx + vy * vy
            if speed2 > PUCK_SPEED_CAP**2:
                share = PUCK_SPEED_CAP / speed2**0.5
                lib.cpBodySetVelocity(body, (vx * share - self.kick, vy * share))
            self._free(self.bodies[first + k])

    def _wall(self, x: float, y: float, depth: float) -> tuple[float, ...] | None:
        """Normal and offset of a wall that a puck is deeper in than ``depth``, m."""
        for nx, ny, line, mx, my, half in self._lines:
            if nx * x + ny * y + line < -depth:
                aside = nx * (y - my) - ny * (x - mx)
                if abs(aside) >= half:
                    return nx, ny, line
        return None

    def _free(self, puck: pymunk.Body) -> None:
        """Let a puck that a paddle squeezes into a wall slip away along the wall.

        Neither wall nor paddle yields to the solver, which would push the puck into
        the wall; in a corner the paddle is left to ride over it.
        """
        x, y = puck.position
        wall = self._wall(x, y, SQUEEZE)
        if wall is None:
            return
        nx, ny, _ = wall
        x, y = self._inside(x, y)
        touch = self.cast.table.paddle_radius + self.cast.table.puck_radius
        for paddle in self.bodies[self.cast.bodies.paddle]:
            px, py = paddle.position
            gap, aside = nx * (x - px) + ny * (y - py), nx * (y - py) - ny * (x - px)
            if gap * gap + aside * aside < touch * touch:
                shift = math.copysign(math.sqrt(touch**2 - gap**2), aside) - aside
                x, y = x - shift * ny, y + shift * nx
        puck.position = self._inside(x, y)

    def _inside(self, x: float, y: float) -> tuple[float, float]:
        for _ in range(2):
            wall = self._wall(x, y, 0.0)
            if wall is not None:
                nx, ny, line = wall
                into = nx * x + ny * y + line
                x, y = x - into * nx, y - into * ny
        return x, y

    def _park(self, puck: int) -> None:
        body = self._raw[self.cast.bodies.puck.start + puck]
        lib.cpBodySetPosition(body, (POCKET * (1 + puck), POCKET))
        lib.cpBodySetVelocity(body, (0.0, 0.0))

    def lift(self, paddle: int, up: bool) -> None:
        """Take a paddle off the table, or put it back: a lifted one touches nothing."""
        mask = 0 if up else pymunk.ShapeFilter.ALL_MASKS()
        self.paddles[paddle].filter = pymunk.ShapeFilter(mask=mask)

    @property
    def pointers(self) -> tuple[int, int]:
        """Addresses of the space and of the first paddle's body."""
        return address(self._space), address(self._raw[0])

    @property
    def out(self) -> dict[int, tuple[float, float]]:
        """Pucks out of play and where they went, m."""
        return self._out


class Pymunk(Backend):
    """B pymunk spaces behind the backend contract."""

    exact: ClassVar[bool] = True
    default_substeps: ClassVar[int] = 10

    def __init__(
        self, cast: Cast, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        super().__init__(cast, num_worlds, control_dt, substeps)
        self._flags = new_flags(num_worlds)
        self.spaces = [Space(cast, control_dt, substeps, row) for row in self._flags]
        self._pointers = np.array([space.pointers for space in self.spaces], np.int64).T
        self._drifts = AVAILABLE and len(cast.seats) == 1 and not cast.path
        mouths = len(cast.mouths)
        self.state = still_state(cast.bodies, num_worlds, mouths)
        self._steps = np.zeros(num_worlds, np.int64)
        self._kicks = np.zeros((num_worlds, 1))
        self._never = np.zeros((num_worlds, len(cast.seats)), np.bool_)
        self._quiet = still_state(cast.bodies, num_worlds, mouths)
        self._turns = cast.blocks > 0 and cast.block_shape == "square"

    def set_physics(self, values: dict[str, Array], mask: Array) -> None:
        for i in np.flatnonzero(mask):
            row = {name: float(value[i]) for name, value in values.items()}
            self.spaces[i].set_physics(row)
            self._kicks[i] = self.spaces[i].kick

    def start(self, state: State, mask: Array) -> None:
        self.state = self.state.scatter(mask, state)
        for row, i in enumerate(np.flatnonzero(mask)):
            position, velocity = state.position[row], state.velocity[row]
            self.spaces[i].start(position, velocity, state.angle[row])
        self._steps[mask] = np.round(state.time / self.control_dt).astype(np.int64)

    def step(self, command: Command) -> State:
        old, bodies, s = self.state, self.cast.bodies, len(self.cast.seats)
        position = old.position[:, :s].copy()
        velocity = old.velocity[:, :s].copy()
        goal, told, lifted = command.velocity, self._never, None
        if command.told is not None:
            goal, told, lifted = self._follow(position, command.told, goal)
        rows = np.empty((self.num_worlds, bodies.movers, 4))
        path = None
        if self.cast.path:
            shape = (self.num_worlds, self.substeps + 1, bodies.movers, 4)
            path = np.empty(shape)
        flags = self._flags
        for i in flags[:, EVENT].nonzero()[0].tolist():
            self.spaces[i].begin()
        left = self._drift(velocity, goal, lifted is not None)
        for i in left:
            way = None if path is None else path[i]
            self.spaces[i].step(position[i], velocity[i], goal[i], told[i], way)
        for i, space in enumerate(self.spaces):
            rows[i] = space.read()
        eventful = flags[:, EVENT].nonzero()[0].tolist()
        rows[:, :s, 2:] = velocity
        rows[:, bodies.puck, 2] += self._kicks
        if path is not None:
            path[:, :, bodies.puck, 2] += self._kicks[:, None]
        self._steps += 1
        place, speed = rows[..., :2], rows[..., 2:]
        if len(bodies) > bodies.movers:
            place = np.concatenate([place, old.position[:, bodies.movers :]], 1)
            speed = np.concatenate([speed, old.velocity[:, bodies.movers :]], 1)
        new = self._quiet.moved(
            place, speed, self._steps * self.control_dt, path, bool(eventful)
        )
        if eventful:
            new = self._with_events(new, eventful)
        if command.told is not None:
            self._land(new, command.told, lifted)
        if self._turns:
            new = self._with_turns(new)
        self.state = new
        return new

    def _drift(self, velocity: Array, goal: Array, any_told: bool) -> list[int]:
        """Step the quiet worlds in compiled code; those that Python must finish."""
        flags = self._flags
        if not self._drifts or any_told:
            flags[:, SUBSTEP] = -1
            return list(range(self.num_worlds))
        sim_dt = self.control_dt / self.substeps
        start = velocity[:, 0].copy()
        spaces, paddles = self._pointers
        drift(spaces, paddles, start, goal[:, 0], self.substeps, sim_dt, flags)
        left: list[int] = flags[:, EVENT].nonzero()[0].tolist()
        velocity[:, 0] = goal[:, 0]
        for i in left:
            velocity[i, 0] = start[i]
        return left

    def _with_events(self, state: State, worlds: list[int]) -> State:
        """The state with the contacts and crossings of some worlds."""
        quiet, names = self._quiet, ("touched", "touched_at", "touching", "crossed")
        arrays = {n: getattr(quiet, n).copy() for n in (*names, "crossed_velocity")}
        puck = self.cast.bodies.puck.start
        for i in worlds:
            space = self.spaces[i]
            for name, array in arrays.items():
                array[i] = getattr(space, name)
            for k, place in space.out.items():
                state.position[i, puck + k] = place
                state.velocity[i, puck + k] = 0.0
        return replace(state, **arrays)

    def _follow(
        self, position: Array, told: Array, goal: Array
    ) -> tuple[Array, Array, Array]:
        """Velocities, who is told and who is lifted, for a command with told seats."""
        is_told = np.asarray(np.isfinite(told).all(-1))
        way = (told[..., :2] - position) / self.control_dt
        lifted = is_told & (np.hypot(way[..., 0], way[..., 1]) > TOLD_SPEED)
        for i, k in zip(*np.nonzero(lifted), strict=True):
            self.spaces[i].lift(int(k), True)
        return np.where(is_told[..., None], way, goal), is_told, lifted

    def _land(self, new: State, told: Array, lifted: Array | None) -> None:
        is_told = np.isfinite(told).all(-1)
        new.velocity[:, : told.shape[1]][is_told] = told[is_told][:, 2:]
        assert lifted is not None
        for i, k in zip(*np.nonzero(lifted), strict=True):
            self.spaces[i].lift(int(k), False)

    def _with_turns(self, state: State) -> State:
        angle, spin = np.zeros((2, *state.time.shape, len(state.bodies)))
        first = self.cast.bodies.block.start
        for i, space in enumerate(self.spaces):
            for k, body in enumerate(space.bodies[first:], start=first):
                angle[i, k], spin[i, k] = body.angle, body.angular_velocity
        return replace(state, angle=angle, spin=spin)


make = Pymunk
