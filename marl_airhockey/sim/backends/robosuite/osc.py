"""Operational space control: torques that move a paddle and press it on the table.

Hybrid control in the table frame (Khatib, 1987) has three parts: motion in the plane, a
force along the normal, and a fixed orientation. The torques of the contact (normal,
orientation, gravity) have priority. The motion in the plane gets the remaining torque.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from marl_airhockey.sim.backends.robosuite.cholesky import factor, solve
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array


@dataclass(frozen=True)
class Gains:
    """Gains of the controller; damping follows from the stiffness."""

    plane: float = PARAMETERS["arm_stiffness"].default
    """Stiffness of the position in the plane, 1/s2."""
    plane_ratio: float = 1.0
    """Damping ratio in the plane."""
    lift: float = 400.0
    """Stiffness toward the table of a paddle that has left it, 1/s2."""
    lift_ratio: float = 3.0
    """Damping ratio along the normal."""
    kp_orientation: float = 1600.0
    """Stiffness of the orientation, 1/s2."""
    orientation_ratio: float = 1.0
    """Damping ratio of the orientation."""
    correction: float = 5.0
    """Largest acceleration in addition to the reference acceleration, m/s2."""
    force: float = PARAMETERS["arm_force"].default
    """Force on the table, N. With 20 N, and a quarter of the orientation stiffness, a
    puck that is jammed in a corner could tilt the paddle by 4 degrees."""

    @property
    def array(self) -> Array:
        """Gains as an array (8,) for `torques`."""
        return np.array(astuple(self))


@compiled()
def torques(
    jacobian: Array,
    drift: Array,
    mass: Array,
    bias: Array,
    speeds: Array,
    position: Array,
    rotation: Array,
    table: Array,
    wanted_rotation: Array,
    reference: Array,
    gains: Array,
    low: Array,
    high: Array,
    out: Array,
) -> float:
    """Compute the torques of the n joints of an arm.

    Args:
        jacobian: Jacobian of the paddle's foot (6, n), world frame. The first three
            rows are the velocity, the last three the angular velocity.
        drift: Time derivative of the Jacobian times the joint speeds (6,).
        mass: Joint-space inertia (n, n), overwritten.
        bias: Gravity, Coriolis and centrifugal torques (n,), Nm.
        speeds: Joint speeds (n,), rad/s.
        position: Position of the foot (3,), table frame, m; z is the height.
        rotation: Rotation from the foot to the world frame (3, 3).
        table: Rotation from the table frame to the world frame (3, 3).
        wanted_rotation: Target of ``rotation`` (3, 3).
        reference: Target position (m), velocity (m/s) and acceleration (m/s2) in the
            plane (3, 2), table frame.
        gains: Gains (8,), see `Gains`.
        low: Smallest torques (n,), Nm.
        high: Largest torques (n,), Nm.
        out: Torques (n,), Nm, filled.

    Returns:
        Share of the motion in the plane that the torque limits allow, 0 to 1.
    """
    twist, contact, motion = np.zeros(6), np.zeros(6), np.zeros(6)
    for i in range(6):
        for j in range(len(speeds)):
            twist[i] += jacobian[i, j] * speeds[j]
    _plane_acceleration(twist, position, table, reference, gains, motion)
    _contact_acceleration(
        *(twist, drift, position, rotation, table, wanted_rotation, gains, contact)
    )
    _to_forces(jacobian, mass, contact, motion)
    for i in range(3):
        contact[i] -= table[i, 2] * gains[7]
    return _fit(jacobian, bias, contact, motion, low, high, out)


@inner()
def _velocity(twist: Array, table: Array) -> Array:
    """Return the velocity (3,) of the foot in the table frame, m/s."""
    velocity = np.zeros(3)
    for i in range(3):
        for j in range(3):
            velocity[i] += table[j, i] * twist[j]
    return velocity


@inner()
def _plane_acceleration(
    twist: Array,
    position: Array,
    table: Array,
    reference: Array,
    gains: Array,
    out: Array,
) -> None:
    """Fill ``out`` (6,) with the target acceleration in the plane, world frame."""
    velocity = _velocity(twist, table)
    damp = 2.0 * gains[1] * np.sqrt(gains[0])
    dx, dy = reference[0, 0] - position[0], reference[0, 1] - position[1]
    ax = gains[0] * dx + damp * (reference[1, 0] - velocity[0])
    ay = gains[0] * dy + damp * (reference[1, 1] - velocity[1])
    size = np.sqrt(ax * ax + ay * ay)
    if size > gains[6]:
        ax, ay = ax * gains[6] / size, ay * gains[6] / size
    ax, ay = ax + reference[2, 0], ay + reference[2, 1]
    for i in range(3):
        out[i] = table[i, 0] * ax + table[i, 1] * ay


@inner()
def _contact_acceleration(
    twist: Array,
    drift: Array,
    position: Array,
    rotation: Array,
    table: Array,
    wanted_rotation: Array,
    gains: Array,
    out: Array,
) -> None:
    """Fill ``out`` (6,) with the acceleration that keeps height and orientation."""
    az = -2.0 * gains[3] * np.sqrt(gains[2]) * _velocity(twist, table)[2]
    if position[2] > 0.0:
        az -= gains[2] * position[2]
    # The error as a rotation vector: half the antisymmetric part of
    # wanted_rotation @ rotation.T.
    error = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                error[i, j] += wanted_rotation[i, k] * rotation[j, k]
    damp = 2.0 * gains[5] * np.sqrt(gains[4])
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        off = 0.5 * (error[b, a] - error[a, b])
        out[i] = table[i, 2] * az - drift[i]
        out[3 + i] = gains[4] * off - damp * twist[3 + i] - drift[3 + i]


@inner()
def _to_forces(jacobian: Array, mass: Array, first: Array, second: Array) -> None:
    """Multiply two accelerations (6,) by the inertia at the foot, in place.

    The inertia is (J M^-1 J^T)^-1. ``mass`` is M; its Cholesky factor overwrites it.
    """
    n = len(mass)
    solved = np.empty((6, n))
    solved[:] = jacobian
    factor(mass)
    for i in range(6):
        solve(mass, solved[i])
    mobility = np.zeros((6, 6))
    for i in range(6):
        for j in range(6):
            for k in range(n):
                mobility[i, j] += jacobian[i, k] * solved[j, k]
    factor(mobility)
    solve(mobility, first)
    solve(mobility, second)


@inner()
def _fit(
    jacobian: Array,
    bias: Array,
    contact: Array,
    motion: Array,
    low: Array,
    high: Array,
    out: Array,
) -> float:
    """Fill ``out`` with torques within their limits; return the share of the motion.

    Args:
        jacobian: Jacobian of the foot (6, n), world frame.
        bias: Gravity, Coriolis and centrifugal torques (n,), Nm.
        contact: Force and torque at the foot that have priority (6,), N and Nm.
        motion: Force and torque of the motion, of which a share is applied (6,).
        low: Smallest torques (n,), Nm.
        high: Largest torques (n,), Nm.
        out: Torques (n,), Nm, filled.
    """
    n, share = len(bias), 1.0
    moving = np.zeros(n)
    for j in range(n):
        out[j] = bias[j]
        for i in range(6):
            out[j] += jacobian[i, j] * contact[i]
            moving[j] += jacobian[i, j] * motion[i]
        if moving[j] > 1e-9:
            share = min(share, (high[j] - out[j]) / moving[j])
        elif moving[j] < -1e-9:
            share = min(share, (low[j] - out[j]) / moving[j])
    share = max(share, 0.0)
    for j in range(n):
        out[j] = min(max(out[j] + share * moving[j], low[j]), high[j])
    return share


@compiled()
def subtract_payload(
    load: float,
    gravity: Array,
    jacobian: Array,
    drift: Array,
    mass: Array,
    bias: Array,
) -> None:
    """Subtract a point mass at the paddle's foot that the controller does not know.

    Args:
        load: Mass, kg.
        gravity: Gravity (3,), world frame, m/s2.
        jacobian: Jacobian of the foot (6, n), world frame.
        drift: Time derivative of the Jacobian times the joint speeds (6,).
        mass: Joint-space inertia (n, n), changed.
        bias: Gravity, Coriolis and centrifugal torques (n,), Nm, changed.
    """
    n = len(bias)
    for i in range(n):
        for k in range(3):
            pull = load * jacobian[k, i]
            bias[i] -= pull * (drift[k] - gravity[k])
            for j in range(n):
                mass[i, j] -= pull * jacobian[k, j]
