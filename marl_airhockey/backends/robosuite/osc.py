"""Torques that move a paddle over the table and keep it pressed on.

Hybrid operational space control in the table frame (Khatib, 1987): motion in the
plane, a force along the normal, a fixed orientation. What keeps the contact (normal,
orientation, gravity) comes first; the motion in the plane gets the torque that is left.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numba import njit

from marl_airhockey.core.physics import PARAMETERS
from marl_airhockey.types import Array


@dataclass(frozen=True)
class Gains:
    """Gains of the law; damping follows from the stiffness."""

    plane: float = PARAMETERS["arm_stiffness"].default
    """1/s2, of the position in the plane"""
    plane_ratio: float = 1.0
    """Damping ratio in the plane"""
    lift: float = 400.0
    """1/s2, toward the table, of a paddle that has left it"""
    lift_ratio: float = 3.0
    """Damping ratio along the normal"""
    kp_orientation: float = 1600.0
    """1/s2, of the orientation"""
    orientation_ratio: float = 1.0
    """Damping ratio of the orientation"""
    correction: float = 5.0
    """m/s2, largest acceleration beside that of the reference"""
    force: float = PARAMETERS["arm_force"].default
    """N, on the table. With 20 N, and a fourth of the stiffness in turning, a puck that
    is jammed in a corner could tip the paddle by 4 degrees."""

    @property
    def array(self) -> Array:
        """As `torques` takes them."""
        return np.array(astuple(self))


@njit(cache=True)
def torques(
    jacobian: Array,
    drift: Array,
    mass: Array,
    bias: Array,
    speeds: Array,
    position: Array,
    rotation: Array,
    table: Array,
    grip: Array,
    reference: Array,
    gains: Array,
    low: Array,
    high: Array,
    out: Array,
) -> float:
    """Torques of the n joints of an arm.

    Args:
        jacobian: (6, n) of the paddle's foot: velocity, angular velocity; world frame.
        drift: (6,) its time derivative times the joint speeds.
        mass: (n, n) joint-space inertia.
        bias: (n,) gravity, Coriolis and centrifugal torques.
        speeds: (n,) joint speeds, rad/s.
        position: (3,) of the foot in the table frame, m; z is its height.
        rotation: (3, 3) of the foot in the world.
        table: (3, 3) from the table frame to the world's.
        grip: (3, 3) wanted rotation.
        reference: (3, 2) wanted position, velocity and acceleration in the plane.
        gains: (8,) of `Gains`.
        low: (n,) smallest torques.
        high: (n,) largest.
        out: (n,) is filled with the torques, Nm.

    Returns:
        The share of the motion in the plane that the torques allow, 0 to 1.
    """
    n = len(speeds)
    twist = np.zeros(6)
    for i in range(6):
        for j in range(n):
            twist[i] += jacobian[i, j] * speeds[j]
    velocity = np.zeros(3)
    for i in range(3):
        for j in range(3):
            velocity[i] += table[j, i] * twist[j]

    damp = 2.0 * gains[1] * np.sqrt(gains[0])
    ax = gains[0] * (reference[0, 0] - position[0]) + damp * (
        reference[1, 0] - velocity[0]
    )
    ay = gains[0] * (reference[0, 1] - position[1]) + damp * (
        reference[1, 1] - velocity[1]
    )
    size = np.sqrt(ax * ax + ay * ay)
    if size > gains[6]:
        ax, ay = ax * gains[6] / size, ay * gains[6] / size
    ax, ay = ax + reference[2, 0], ay + reference[2, 1]
    az = -2.0 * gains[3] * np.sqrt(gains[2]) * velocity[2]
    if position[2] > 0.0:
        az -= gains[2] * position[2]

    # Half the antisymmetric part of grip @ rotation.T: the error as a rotation vector.
    error = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                error[i, j] += grip[i, k] * rotation[j, k]
    turn_damp = 2.0 * gains[5] * np.sqrt(gains[4])
    first, second = np.zeros(6), np.zeros(6)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        off = 0.5 * (error[b, a] - error[a, b])
        first[i] = table[i, 2] * az - drift[i]
        first[3 + i] = gains[4] * off - turn_damp * twist[3 + i] - drift[3 + i]
        second[i] = table[i, 0] * ax + table[i, 1] * ay

    # The inertia that the foot is felt with: (J M^-1 J^T)^-1.
    solved = np.empty((6, n))
    solved[:] = jacobian
    _factor(mass)
    for i in range(6):
        _solve(mass, solved[i])
    felt = np.zeros((6, 6))
    for i in range(6):
        for j in range(6):
            for k in range(n):
                felt[i, j] += jacobian[i, k] * solved[j, k]
    _factor(felt)
    _solve(felt, first)
    _solve(felt, second)
    for i in range(3):
        first[i] -= table[i, 2] * gains[7]

    share = 1.0
    motion = np.zeros(n)
    for j in range(n):
        out[j] = bias[j]
        for i in range(6):
            out[j] += jacobian[i, j] * first[i]
            motion[j] += jacobian[i, j] * second[i]
        if motion[j] > 1e-9:
            share = min(share, (high[j] - out[j]) / motion[j])
        elif motion[j] < -1e-9:
            share = min(share, (low[j] - out[j]) / motion[j])
    share = max(share, 0.0)
    for j in range(n):
        out[j] = min(max(out[j] + share * motion[j], low[j]), high[j])
    return share


@njit(cache=True)
def subtract_payload(
    load: float,
    gravity: Array,
    jacobian: Array,
    drift: Array,
    mass: Array,
    bias: Array,
) -> None:
    """Take a point mass at the paddle's foot out of what the law knows of its arm.

    Args:
        load: kg.
        gravity: (3,) m/s2, world frame.
        jacobian: (6, n) of the foot.
        drift: (6,) its time derivative times the joint speeds.
        mass: (n, n) joint-space inertia, changed.
        bias: (n,) gravity, Coriolis and centrifugal torques, changed.
    """
    n = len(bias)
    for i in range(n):
        for k in range(3):
            pull = load * jacobian[k, i]
            bias[i] -= pull * (drift[k] - gravity[k])
            for j in range(n):
                mass[i, j] -= pull * jacobian[k, j]


@njit(cache=True)
def _factor(a: Array) -> None:
    """Cholesky's lower factor of a symmetric positive matrix, in place."""
    n = len(a)
    for j in range(n):
        for k in range(j):
            a[j, j] -= a[j, k] * a[j, k]
        a[j, j] = np.sqrt(a[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                a[i, j] -= a[i, k] * a[j, k]
            a[i, j] /= a[j, j]


@njit(cache=True)
def _solve(factor: Array, b: Array) -> None:
    """Solve with a Cholesky factor, in place."""
    n = len(b)
    for i in range(n):
        for k in range(i):
            b[i] -= factor[i, k] * b[k]
        b[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= factor[k, i] * b[k]
        b[i] /= factor[i, i]


@njit(cache=True)
def reference(
    start: Array, old: Array, new: Array, period: float, elapsed: float, out: Array
) -> None:
    """The wanted motion some time into a control step: a linear ramp of velocity.

    Args:
        start: (2,) m at its beginning.
        old: (2,) m/s at its beginning.
        new: (2,) m/s at its end.
        period: s of the step.
        elapsed: s since its beginning.
        out: (3, 2) is filled with position, velocity and acceleration.
    """
    for i in range(2):
        a = (new[i] - old[i]) / period
        out[0, i] = start[i] + old[i] * elapsed + 0.5 * a * elapsed * elapsed
        out[1, i] = old[i] + a * elapsed
        out[2, i] = a
