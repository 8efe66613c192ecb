"""Limits of an arm's joints, read from its controller, and a check of the workspace.

The controller's state contains the limits of the joints, but not the safety limits of
the tool (speed and force). A person reads these from the pendant.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from marl_airhockey.hardware.robot.kinematics import (
    JOINTS,
    forward,
    inverse,
    joint_speeds,
    pose_of,
)
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.sim.core.geometry import half_planes
from marl_airhockey.types import Array

STATE_PORT = 30012
"""Read-only port of a controller's state."""
STATE, JOINT_DATA, CONFIGURATION = 16, 1, 6
"""Numbers of a message and of two of its packages, from the maker's documentation."""
JOINT = struct.Struct(">3d4fB")
"""Format of a joint in its package; the first number is the angle, rad."""
BOUNDS = struct.Struct(f">{4 * JOINTS}d")
"""Format of the least and largest angles of all joints, then of their largest speeds
and accelerations."""
ANSWER = 3.0
"""Longest time until a controller sends its state, s."""
SHARE = 0.95
"""Largest share of a joint's speed limit that motion in the workspace may need."""
SPACING = 9
"""Number of checked positions along each side of the workspace."""


class JointLimits(NamedTuple):
    """Limits of the joints and their present angles."""

    least: Array
    """Least angles (6,), rad."""
    most: Array
    """Largest angles (6,), rad."""
    speed: Array
    """Largest speeds (6,), rad/s."""
    angles: Array
    """Present angles (6,), rad."""


def read_limits(host: str, port: int = STATE_PORT) -> JointLimits:
    """Read the limits of an arm from its controller.

    Args:
        host: Address of the controller.
        port: Port that sends the controller's state.

    Raises:
        OSError: No controller responds, or it reports no limits.
    """
    with socket.create_connection((host, port), ANSWER) as link:
        link.settimeout(ANSWER)
        file = link.makefile("rb")
        # The first message is the version; not every state has all packages.
        for _ in range(20):
            size, kind = struct.unpack(">iB", _exactly(file.read, 5))
            body = _exactly(file.read, size - 5)
            packages = _packages(body) if kind == STATE else {}
            if {JOINT_DATA, CONFIGURATION} <= packages.keys():
                return _limits(packages)
    raise OSError(f"the controller at {host} reports no joint limits")


def _exactly(read: Callable[[int], bytes], count: int) -> bytes:
    data = read(count)
    if len(data) < count:
        raise OSError("the controller closed the connection")
    return data


def _packages(body: bytes) -> dict[int, bytes]:
    """Return the packages of a state by their numbers."""
    found: dict[int, bytes] = {}
    while len(body) > 5:
        size, kind = struct.unpack(">iB", body[:5])
        if size < 5:
            break
        found[kind], body = body[5:size], body[size:]
    return found


def _limits(packages: dict[int, bytes]) -> JointLimits:
    joints = JOINT.iter_unpack(packages[JOINT_DATA][: JOINTS * JOINT.size])
    angles = np.array([joint[0] for joint in joints])
    bounds = np.array(BOUNDS.unpack(packages[CONFIGURATION][: BOUNDS.size]))
    (least, most), (speed, _) = (half.T for half in bounds.reshape(2, JOINTS, 2))
    return JointLimits(least, most, speed, angles)


def check_reach(
    limits: JointLimits, mounting: Mounting, tool: Array, reach: Array, speed: float
) -> None:
    """Check that an arm stays within its joint limits in the whole workspace.

    Args:
        limits: Limits of the arm's joints.
        mounting: Mounting of the table.
        tool: Pose (6,) of the paddle's foot, flange frame, m and rad.
        reach: Workspace, a polygon (n, 2) of the paddle's centre, table frame, m.
        speed: Top speed of the paddle, in any direction, m/s.

    Raises:
        ValueError: The arm does not reach a position, or a joint exceeds its limits
            there. The message gives the position.
    """
    flange_of = np.linalg.inv(pose_of(tool))
    angles, rotation = limits.angles, np.array(mounting.rotation)
    for place in _places(reach):
        pose = pose_of(mounting.pose(place))
        there, angles = inverse(pose @ flange_of, angles, 200)
        where = f"with the paddle at x {place[0]:+.2f}, y {place[1]:+.2f} m"
        if not there:
            raise ValueError(
                f"robot: the arm does not reach the table {where}; check the mounting"
            )
        beyond = (angles < limits.least) | (angles > limits.most)
        if beyond.any():
            raise ValueError(
                f"robot: {where} joint {int(beyond.argmax())} is beyond its limit"
            )
        flange, jacobian = forward(angles)
        lever = pose[:3, 3] - flange[:3, 3]
        jacobian[:3] += np.cross(jacobian[3:].T, lever).T
        ways = np.zeros((6, 2))
        ways[:3] = rotation[:, :2]
        needed = np.stack([joint_speeds(jacobian, way) for way in ways.T])
        # The largest speed over all directions is the norm over the two axes.
        share = speed * np.linalg.norm(needed, axis=0) / limits.speed
        if share.max() > SHARE:
            raise ValueError(
                f"robot: {where} joint {int(share.argmax())} needs {share.max():.0%} "
                f"of its speed limit for {speed} m/s; lower limits.speed, or "
                "mount the table nearer"
            )


def _places(reach: Array) -> Array:
    """Return positions (m, 2) in a polygon (n, 2), each near the previous one."""
    low, high = reach.min(0), reach.max(0)
    lines = [
        np.column_stack([np.full(SPACING, x), np.linspace(low[1], high[1], SPACING)])
        for x in np.linspace(low[0], high[0], SPACING)
    ]
    grid = np.concatenate([line[:: (-1) ** k] for k, line in enumerate(lines)])
    normals, offsets = half_planes(tuple((x, y) for x, y in reach.tolist()))
    inside = (grid @ normals.T + offsets >= -1e-9).all(1)
    return np.concatenate([grid[inside], reach])
