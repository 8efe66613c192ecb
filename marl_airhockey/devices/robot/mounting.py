"""Mounting: where a table lies in the frame of a robot's base."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from marl_airhockey.devices.robot.kinematics import matrix_of
from marl_airhockey.types import Array


@dataclass(frozen=True)
class Mounting:
    """Pose of the table in the base frame of a robot, and of the tool on the table."""

    origin: tuple[float, float, float]
    """Table's centre, base frame, m"""
    rotation: tuple[tuple[float, float, float], ...]
    """(3, 3) from the table frame to the base's"""
    tool: tuple[float, float, float]
    """Rotation vector of the tool that stands on the table, base frame"""
    residual: float = 0.0
    """Root of the mean squared error of the fit, m"""
    points: int = 0
    """Number of points that it was fitted to"""
    _origin: Array = field(init=False, repr=False, compare=False)
    _rotation: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_origin", np.array(self.origin))
        object.__setattr__(self, "_rotation", np.array(self.rotation))

    @classmethod
    def of(
        cls,
        origin: Array,
        rotation: Array,
        tool: Array,
        residual: float = 0.0,
        points: int = 0,
    ) -> Self:
        """Return the mounting of some arrays (3,), (3, 3) and (3,)."""
        x, y, z = origin.tolist()
        a, b, c = tool.tolist()
        rows = tuple(tuple(row) for row in rotation.tolist())
        return cls((x, y, z), rows, (a, b, c), residual, points)

    @property
    def tilt(self) -> float:
        """Angle between the table's plane and the base's, deg."""
        return float(np.degrees(np.arccos(np.clip(self._rotation[2, 2], -1.0, 1.0))))

    def pose(self, place: Array, height: float = 0.0) -> Array:
        """Return the pose (6,), base frame, of a tool over (2,), table frame, m."""
        point = self._origin + self._rotation @ (place[0], place[1], height)
        return np.concatenate([point, self.tool])

    def frame(self) -> Array:
        """Return the table's frame as a pose (6,), base frame."""
        import cv2

        return np.concatenate([self.origin, cv2.Rodrigues(self._rotation)[0][:, 0]])

    def to_table(self, pose: Array) -> Array:
        """Return (3,) of the tool's centre, table frame, m, from a pose (6,)."""
        return np.asarray((np.asarray(pose)[:3] - self._origin) @ self._rotation)

    def rotate_to_table(self, velocity: Array) -> Array:
        """Return (3,) a velocity, base frame, in the table's."""
        return np.asarray(np.asarray(velocity)[:3] @ self._rotation)


def fit_mounting(points: Array, touched: Array, tool: Array) -> Mounting:
    """Fit a mounting to places that a tool has touched.

    Args:
        points: (n, 2) places on the table, table frame, m; at least 3, not in a line.
        touched: (n, 3) the tool's centre there, base frame, m.
        tool: (3,) rotation vector of the tool.

    Raises:
        ValueError: too few points, all in a line, or a table whose plane the tool would
            touch from below: what the camera sees is mirrored.
    """
    points, touched = np.asarray(points, float), np.asarray(touched, float)
    if len(points) < 3 or len(points) != len(touched):
        raise ValueError(f"{len(points)} points: a mounting takes at least 3 pairs")
    flat = np.column_stack([points, np.zeros(len(points))])
    middle, base = flat.mean(0), touched.mean(0)
    u, size, vt = np.linalg.svd((touched - base).T @ (flat - middle))
    if size[1] < 1e-3 * max(size[0], 1e-12):
        raise ValueError("all points lie in a line: touch some beside it")
    sign = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    rotation = u @ sign @ vt
    into = matrix_of(np.asarray(tool, float))[:, 2]
    if rotation[:, 2] @ into > 0.0:
        raise ValueError(
            "the points are mirrored: the tool would touch the table from below; is "
            "the camera's picture flipped, were the corners clicked in the other "
            "direction, or is y counted the other way?"
        )
    origin = base - rotation @ middle
    off = touched - (origin + flat @ rotation.T)
    residual = float(np.sqrt((off**2).sum(1).mean()))
    return Mounting.of(origin, rotation, np.asarray(tool), residual, len(points))
