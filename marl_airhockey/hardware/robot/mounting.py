"""Pose of a table in the base frame of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from marl_airhockey.hardware.robot.kinematics import matrix_of, vector_of
from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.types import Array

FULL_ROTATION = 2.0 * np.pi
"""Largest component of a rotation vector, rad."""
STEEP = 45.0
"""Largest angle between the table's normal and the z axis of the base, deg."""
OBLIQUE = 10.0
"""Largest angle between the tool's z axis and the direction into the table, deg."""


@dataclass(frozen=True)
class Mounting:
    """Pose of the table and orientation of the tool, base frame of a robot.

    Raises:
        ValueError: The matrix is not a rotation, the table does not face up, or the
            tool does not point into the table.
    """

    origin: tuple[float, float, float]
    """Centre of the table, base frame, m."""
    rotation: tuple[tuple[float, float, float], ...]
    """Rotation (3, 3) from the table frame to the base frame."""
    tool: tuple[float, float, float]
    """Rotation vector of the tool on the table, base frame, rad."""
    residual: float = 0.0
    """Root mean square error of the fit, m."""
    points: int = 0
    """Number of points of the fit."""

    def __post_init__(self) -> None:
        check_fields(
            self, origin=(-3, 3), tool=(-FULL_ROTATION, FULL_ROTATION), residual=(0, 1)
        )
        self._check_handedness()

    @cached_property
    def _origin(self) -> Array:
        return np.array(self.origin, float)

    @cached_property
    def _rotation(self) -> Array:
        return np.array(self.rotation, float)

    def _check_handedness(self) -> None:
        """Check that the table is not mirrored, faces up, and has the tool above it."""
        rotation = self._rotation
        off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if off > 1e-3 or np.linalg.det(rotation) < 0.0:
            raise ValueError(
                f"rotation: {self.rotation}; expected a right-handed rotation matrix, "
                "with columns of length 1 at right angles"
            )
        lean = np.degrees(np.arccos(np.clip(rotation[2, 2], -1.0, 1.0)))
        if lean > STEEP:
            raise ValueError(
                f"rotation: the table's normal is {lean:.0f} deg away from the base's "
                f"z; expected at most {STEEP:.0f}"
            )
        into = matrix_of(np.array(self.tool, float))[:, 2]
        off = np.degrees(np.arccos(np.clip(-into @ rotation[:, 2], -1.0, 1.0)))
        if off > OBLIQUE:
            raise ValueError(
                f"tool: its z is {off:.0f} deg away from the direction into the table; "
                f"expected at most {OBLIQUE:.0f}"
            )

    @classmethod
    def of(
        cls,
        origin: Array,
        rotation: Array,
        tool: Array,
        residual: float = 0.0,
        points: int = 0,
    ) -> Self:
        """Return a mounting from arrays of shape (3,), (3, 3) and (3,)."""
        x, y, z = origin.tolist()
        a, b, c = tool.tolist()
        rows = tuple(tuple(row) for row in rotation.tolist())
        return cls((x, y, z), rows, (a, b, c), residual, points)

    @property
    def tilt(self) -> float:
        """Angle between the planes of the table and of the base, deg."""
        return float(np.degrees(np.arccos(np.clip(self._rotation[2, 2], -1.0, 1.0))))

    def pose(self, place: Array, height: float = 0.0) -> Array:
        """Return the pose (6,), base frame, of a tool above the table, m and rad.

        Args:
            place: Position (2,), table frame, m.
            height: Height above the table, m.
        """
        point = self._origin + self._rotation @ (place[0], place[1], height)
        return np.concatenate([point, self.tool])

    def frame(self) -> Array:
        """Return the pose (6,) of the table frame, base frame, m and rad."""
        import cv2

        return np.concatenate([self.origin, cv2.Rodrigues(self._rotation)[0][:, 0]])

    def to_table(self, pose: Array) -> Array:
        """Return the position (3,), table frame, m, of a pose (6,), base frame."""
        return np.asarray((np.asarray(pose)[:3] - self._origin) @ self._rotation)

    def misalignment(self, pose: Array) -> float:
        """Return the angle of a pose (6,) from the orientation on the table, rad."""
        here, there = (matrix_of(np.array(v, float)) for v in (pose[3:], self.tool))
        return float(np.linalg.norm(vector_of(np.ascontiguousarray(here @ there.T))))

    def rotate_to_table(self, velocity: Array) -> Array:
        """Return a velocity (3,), base frame, in the table frame, m/s."""
        return np.asarray(np.asarray(velocity)[:3] @ self._rotation)


def fit_mounting(points: Array, touched: Array, tool: Array) -> Mounting:
    """Fit a mounting to points that a tool has touched.

    Args:
        points: Points (n, 2) on the table, table frame, m; at least 3, not collinear.
        touched: Positions (n, 3) of the tool centre at these points, base frame, m.
        tool: Rotation vector (3,) of the tool, base frame, rad.

    Raises:
        ValueError: There are too few points, they are collinear, or they are mirrored,
            so that the tool would touch the table from below.
    """
    points, touched = np.asarray(points, float), np.asarray(touched, float)
    if len(points) < 3 or len(points) != len(touched):
        raise ValueError(f"{len(points)} points; a mounting needs at least 3 pairs")
    flat = np.column_stack([points, np.zeros(len(points))])
    middle, base = flat.mean(0), touched.mean(0)
    u, size, vt = np.linalg.svd((touched - base).T @ (flat - middle))
    if size[1] < 1e-3 * max(size[0], 1e-12):
        raise ValueError("all points lie in a line; touch some next to it")
    sign = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    rotation = u @ sign @ vt
    into = matrix_of(np.asarray(tool, float))[:, 2]
    if rotation[:, 2] @ into > 0.0:
        raise ValueError(
            "the points are mirrored: the tool would touch the table from below; is "
            "the camera's image flipped, were the corners clicked in the opposite "
            "direction, or does y have the wrong sign?"
        )
    origin = base - rotation @ middle
    off = touched - (origin + flat @ rotation.T)
    residual = float(np.sqrt((off**2).sum(1).mean()))
    return Mounting.of(origin, rotation, np.asarray(tool), residual, len(points))
