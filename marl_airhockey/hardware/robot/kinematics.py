"""Kinematics of a UR5e: poses of the flange from joint angles, and back.

Angles are in rad, lengths in m. Rotations are matrices, or rotation vectors as in the
controller's protocol. The Denavit-Hartenberg parameters are those that the maker has
published for the UR5e.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array

JOINTS = 6
LENGTH = np.array([0.0, -0.425, -0.3922, 0.0, 0.0, 0.0])
"""Denavit-Hartenberg parameters a, m."""
OFFSET = np.array([0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996])
"""Denavit-Hartenberg parameters d, m."""
TWIST = np.array([np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0])
"""Denavit-Hartenberg parameters alpha, rad."""
TOLERANCE = 1e-8
"""Largest norm of the error of an inverse solution, m and rad combined."""
DAMPING = 1e-7
"""Damping of the inverse, which keeps it bounded at a singular pose."""


@compiled()
def forward(angles: Array) -> tuple[Array, Array]:
    """Return the pose (4, 4) of the flange and its Jacobian (6, 6), base frame."""
    pose = np.eye(4)
    axes, places = np.empty((JOINTS, 3)), np.empty((JOINTS, 3))
    for k in range(JOINTS):
        axes[k], places[k] = pose[:3, 2], pose[:3, 3]
        ct, st = np.cos(angles[k]), np.sin(angles[k])
        ca, sa = np.cos(TWIST[k]), np.sin(TWIST[k])
        link = np.array(
            [
                [ct, -st * ca, st * sa, LENGTH[k] * ct],
                [st, ct * ca, -ct * sa, LENGTH[k] * st],
                [0.0, sa, ca, OFFSET[k]],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        pose = pose @ link
    jacobian = np.empty((6, JOINTS))
    for k in range(JOINTS):
        jacobian[:3, k] = np.cross(axes[k], pose[:3, 3] - places[k])
        jacobian[3:, k] = axes[k]
    return pose, jacobian


@compiled()
def inverse(pose: Array, guess: Array, iterations: int = 30) -> tuple[bool, Array]:
    """Find the joint angles of a pose (4, 4) that are near a guess (6,).

    Returns:
        True if there are such angles, and the angles (6,), rad, or the last that were
        tried.
    """
    angles = guess.copy()
    error = np.empty(6)
    for _ in range(iterations):
        here, jacobian = forward(angles)
        error[:3] = pose[:3, 3] - here[:3, 3]
        rotated = np.ascontiguousarray(pose[:3, :3]) @ np.ascontiguousarray(
            here[:3, :3].T
        )
        error[3] = 0.5 * (rotated[2, 1] - rotated[1, 2])
        error[4] = 0.5 * (rotated[0, 2] - rotated[2, 0])
        error[5] = 0.5 * (rotated[1, 0] - rotated[0, 1])
        if np.sqrt((error * error).sum()) < TOLERANCE:
            return True, angles
        square = jacobian @ jacobian.T + DAMPING * np.eye(6)
        step = jacobian.T @ np.linalg.solve(square, error)
        most = np.abs(step).max()
        angles += step * min(1.0, 0.3 / max(most, 1e-12))
    return False, angles


@compiled()
def joint_speeds(jacobian: Array, twist: Array) -> Array:
    """Return the joints' speeds (6,) that move the flange by a twist (6,)."""
    square = jacobian @ jacobian.T + DAMPING * np.eye(6)
    speeds: Array = jacobian.T @ np.linalg.solve(square, twist)
    return speeds


@compiled()
def matrix_of(vector: Array) -> Array:
    """Return the rotation matrix (3, 3) of a rotation vector (3,)."""
    angle = np.sqrt((vector * vector).sum())
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    c, s = np.cos(angle), np.sin(angle)
    t = 1.0 - c
    return np.array(
        [
            [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
            [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
            [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
        ]
    )


@compiled()
def vector_of(matrix: Array) -> Array:
    """Return the rotation vector (3,) of a rotation matrix (3, 3)."""
    trace = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    angle = np.arccos(min(max((trace - 1.0) / 2.0, -1.0), 1.0))
    if angle < 1e-9:
        return np.zeros(3)
    axis = np.array(
        [
            matrix[2, 1] - matrix[1, 2],
            matrix[0, 2] - matrix[2, 0],
            matrix[1, 0] - matrix[0, 1],
        ]
    )
    if np.pi - angle < 1e-5:
        # Half a turn: the symmetric part gives the axis, the rest gives its sign.
        square = (matrix + np.eye(3)) / 2.0
        k = int(np.argmax(np.diag(square)))
        found = square[:, k] / np.sqrt(square[k, k])
        if (found * axis).sum() < 0.0:
            found = -found
        half: Array = angle * found
        return half
    vector: Array = angle * axis / (2.0 * np.sin(angle))
    return vector


def pose_of(vector: Array) -> Array:
    """Return the pose (4, 4) of a position, m, and a rotation vector, rad (6,)."""
    pose = np.eye(4)
    pose[:3, 3], pose[:3, :3] = vector[:3], matrix_of(np.asarray(vector[3:]))
    return pose


def pose_vector(pose: Array) -> Array:
    """Return the position, m, and rotation vector, rad (6,), of a pose (4, 4)."""
    return np.concatenate([pose[:3, 3], vector_of(np.ascontiguousarray(pose[:3, :3]))])
