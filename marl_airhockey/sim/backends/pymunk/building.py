"""Builders of a pymunk space: bodies, walls and goal lines of a scene."""

from __future__ import annotations

import numpy as np
import pymunk

from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

PADDLE, PUCK, WALL, GOAL_LINE, BLOCK = 1, 2, 3, 4, 5
"""Collision types."""
THICK = 0.5
"""Thickness of a wall, m; no body passes it within a substep."""
NOTHING, EVERYTHING = pymunk.ShapeFilter(mask=0), pymunk.ShapeFilter()
"""Filters of shapes that touch no other shape, and of shapes that touch all."""


class SpaceBodies:
    """Bodies of a scene in a space, in the order of a `State`.

    Args:
        space: Space that the bodies are added to.
        scene: Scene of the bodies.
    """

    def __init__(self, space: pymunk.Space, scene: Scene) -> None:
        self._space = space
        self.all: list[pymunk.Body] = []
        self.shapes: list[pymunk.Shape] = []
        """Shape of each body."""
        self.index: dict[pymunk.Shape, int] = {}
        """Index of each shape among the shapes of its kind."""
        self.friction_joints: list[pymunk.Constraint] = []
        """Friction joints of position and angle, two for each block."""
        for i in range(len(scene.seats)):
            body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            self._add(pymunk.Circle(body, scene.table.paddle_radius), PADDLE, i)
        for i in range(scene.pucks):
            body = pymunk.Body(1.0, 1.0)
            self._add(pymunk.Circle(body, scene.table.puck_radius), PUCK, i)
        for i in range(scene.blocks):
            body = pymunk.Body(1.0, float("inf"))
            size = 2 * scene.block_radius
            shape: pymunk.Shape = pymunk.Circle(body, scene.block_radius)
            if scene.block_shape == "square":
                shape = pymunk.Poly.create_box(body, (size, size))
            self._add(shape, BLOCK, i)
            self._hold(body)

    def _add(self, shape: pymunk.Shape, kind: int, index: int) -> None:
        assert shape.body is not None
        shape.collision_type, shape.friction = kind, 0.0
        self._space.add(shape.body, shape)
        self.all.append(shape.body)
        self.shapes.append(shape)
        self.index[shape] = index

    def _hold(self, body: pymunk.Body) -> None:
        """Add Coulomb friction on the table: joints with a maximum force."""
        static = self._space.static_body
        for joint in (
            pymunk.PivotJoint(static, body, (0, 0), (0, 0)),
            pymunk.GearJoint(static, body, 0.0, 1.0),
        ):
            joint.max_bias = 0.0
            self._space.add(joint)
            self.friction_joints.append(joint)


class SpaceWalls:
    """Walls: boxes behind every side of the table, with a sensor in each goal opening.

    Args:
        space: Space that the walls are added to.
        scene: Scene of the walls.
    """

    def __init__(self, space: pymunk.Space, scene: Scene) -> None:
        self._space, self._scene = space, scene
        self.all: list[pymunk.Shape] = []
        self.plugs: dict[int, pymunk.Shape] = {}
        """Walls that close goal lines, by goal line; no contacts while it is open."""
        self.goal_line: dict[pymunk.Shape, int] = {}
        """Goal line of each shape; a puck that touches the shape crosses the line."""
        self.side: dict[pymunk.Shape, int] = {}
        """Side of the table of each wall."""
        for side in range(len(scene.table.vertices)):
            self._build_side(side)
        for obstacle in scene.obstacles:
            end = obstacle.end or obstacle.start
            shape = pymunk.Segment(
                space.static_body, obstacle.start, end, obstacle.radius
            )
            self._add(shape, WALL)

    def _build_side(self, side: int) -> None:
        scene = self._scene
        start, end = scene.table.ends(side)
        along = (end - start) / np.linalg.norm(end - start)
        out = -scene.table.normals[side] * THICK
        lines = [line for line in scene.goal_lines if line.side == side]
        cuts = [start - along * THICK]
        for line in lines:
            if line.width is not None:
                cuts += self._build_goal(scene.goal_lines.index(line), out)
        cuts.append(end + along * THICK)
        for a, b in zip(cuts[::2], cuts[1::2], strict=True):
            wall = self._add(self._box(a, b, out), WALL)
            self.side[wall] = side
            for line in lines:
                if line.width is None:
                    wall.collision_type = GOAL_LINE
                    self.goal_line[wall] = scene.goal_lines.index(line)

    def _build_goal(self, index: int, out: Array) -> list[Array]:
        """Add the sensor and the closing wall of a goal line; return its ends, m."""
        line, table = self._scene.goal_lines[index], self._scene.table
        start, end = table.ends(line.side)
        along = (end - start) / np.linalg.norm(end - start)
        middle, half = (start + end) / 2, along * (line.width or 0.0) / 2
        # The sensor begins one radius behind the line, where the centre has passed it.
        depth = out / THICK * table.puck_radius
        sensor = self._box(middle - half + depth, middle + half + depth, out)
        sensor.sensor, sensor.collision_type = True, GOAL_LINE
        self.goal_line[sensor] = index
        self._space.add(sensor)
        plug = self._add(self._box(middle - half, middle + half, out), WALL)
        plug.filter = NOTHING
        self.plugs[index], self.side[plug] = plug, line.side
        return [middle - half, middle + half]

    def _box(self, a: Array, b: Array, out: Array) -> pymunk.Shape:
        corners = [(float(x), float(y)) for x, y in (a, b, b + out, a + out)]
        box = pymunk.Poly(self._space.static_body, corners)
        box.friction = 0.0
        return box

    def _add(self, wall: pymunk.Shape, kind: int) -> pymunk.Shape:
        wall.friction, wall.collision_type = 0.0, kind
        self.all.append(wall)
        self._space.add(wall)
        return wall
