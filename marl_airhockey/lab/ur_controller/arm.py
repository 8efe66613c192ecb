"""Arm: the joints of a simulated UR5e, what moves them, and what stops them."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from marl_airhockey.devices.robot.kinematics import (
    forward,
    inverse,
    joint_speeds,
    pose_of,
    pose_vector,
)
from marl_airhockey.types import Array

DT = 0.002
"""Period of the controller, s"""
HALF_RISE = 1.678
"""Time times frequency at which a critically damped lag is half-way"""
JOINT_SPEED = np.pi
"""Largest speed of a joint, rad/s: the maker's 180 degrees a second"""
JOINT_ACCELERATION = 25.0
"""Largest acceleration of a joint that the model's drives give, rad/s2"""
STOP_DECELERATION = 20.0
"""Deceleration of the fastest joint in a protective or emergency stop, rad/s2"""
DEVIATION = 0.5
"""Distance of a joint from where it is told to be that is a fault, rad"""
STIFFNESS = 2e4
"""Stiffness of the surface under a paddle that is pressed on it, N/m"""


class Safety(IntEnum):
    """Safety mode, as the controller's protocol numbers it."""

    NORMAL = 1
    PROTECTIVE_STOP = 3
    ROBOT_EMERGENCY_STOP = 7


SAFETY_BITS = {
    Safety.NORMAL: 1 << 0,
    Safety.PROTECTIVE_STOP: 1 << 2,
    Safety.ROBOT_EMERGENCY_STOP: (1 << 6) | (1 << 7),
}
"""Bits of ``safety_status_bits``"""


@dataclass
class Servo:
    """Motion toward a pose, as `servoL` commands it."""

    pose: Array
    """(6,) of the tool: m and rotation vector"""
    half_rise: float
    """Time to half of a step, s"""


@dataclass
class Speed:
    """Motion at a velocity that never ends by itself, as `speedL` commands it."""

    twist: Array
    """(6,) m/s and rad/s"""
    acceleration: float
    """m/s2"""


@dataclass
class Line:
    """Straight way to a pose, as `moveL` commands it."""

    pose: Array
    """(6,)"""
    speed: float
    """m/s"""
    acceleration: float
    """m/s2"""


@dataclass
class Halt:
    """Braking to rest."""

    deceleration: float = STOP_DECELERATION
    """Of the fastest joint, rad/s2"""


@dataclass
class Force:
    """Compliance along the z axis of a frame."""

    frame: Array
    """(6,) pose"""
    newtons: float
    """Wanted force along it"""
    speed: float
    """Largest speed along it, m/s"""


@dataclass
class Surface:
    """Plane that a paddle rests on, in the base frame."""

    origin: Array
    """(3,) m"""
    normal: Array
    """(3,) upward"""
    raised: float = 0.0
    """Height of what lies under the paddle, m"""


@dataclass
class Arm:
    """Arm of six joints, moved by a step of `DT`.

    What moves it is its ``motion``; a motion that joints cannot follow, or that is too
    fast for the tool, ends in a protective stop, as on the real one.
    """

    angles: Array
    """(6,) rad, at the start"""
    tool: Array
    """(6,) pose of the tool's centre in the flange's frame"""
    surface: Surface
    tool_speed: float = 1.5
    """Speed of the tool's centre beyond which the arm stops, m/s"""
    motion: Servo | Speed | Line | Halt = field(default_factory=Halt)
    force: Force | None = None
    safety: Safety = Safety.NORMAL
    stopped: str = ""
    """Cause of the last stop"""

    def __post_init__(self) -> None:
        self.speeds = np.zeros(6)
        self.rates = np.zeros(6)
        self.aim = self.angles.copy()
        """Angles that the motion wants"""
        self.contact = 0.0
        """Force of the surface on the tool, N"""
        self.payload = 0.0
        self.mount(self.tool)
        self._height = self._above(self.pose[:3, 3])

    def mount(self, tool: Array) -> None:
        """Take the tool's centre to be at a pose (6,) in the flange's frame."""
        self.tool, self._tool = tool, pose_of(tool)
        self._off_tool = np.linalg.inv(self._tool)
        self._look()

    def _look(self) -> None:
        flange, jacobian = forward(self.angles)
        self.pose = flange @ self._tool
        """(4, 4) of the tool's centre, base frame"""
        x, y, z = self.pose[:3, 3] - flange[:3, 3]
        lever = np.array([(0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)])
        jacobian[:3] += lever @ jacobian[3:]
        self._jacobian = jacobian
        self.twist = jacobian @ self.speeds
        """(6,) m/s and rad/s of the tool's centre"""

    def _above(self, place: Array) -> float:
        return float((place - self.surface.origin) @ self.surface.normal)

    def rehearse(self) -> None:
        """Make every motion on a copy, so that all is compiled before time counts."""
        twin, pose = deepcopy(self), pose_vector(self.pose)
        twin.press(Force(pose, 1.0, 0.1))
        twin.servo(pose, 0.1)
        for motion in (twin.motion, Speed(np.zeros(6), 1.0), Line(pose, 0.1, 1.0)):
            twin.motion = motion
            twin.step()

    def reachable(self, pose: Array) -> bool:
        """Return True if some joint angles near these give the tool this pose (6,)."""
        return self._solve(pose) is not None

    def _solve(self, pose: Array) -> Array | None:
        if not np.isfinite(pose).all():
            return None
        flange = pose_of(pose) @ self._off_tool
        found, angles = inverse(flange, self.aim)
        return angles if found else None

    def stop(self, mode: Safety, why: str) -> None:
        """Stop for safety: brake, and take no motion until it is released."""
        if self.safety is Safety.ROBOT_EMERGENCY_STOP:
            return
        self.safety, self.stopped = mode, why
        self.motion, self.force = Halt(), None

    def release(self) -> None:
        """Take motions again; the arm stands still until one comes."""
        self.safety, self.stopped = Safety.NORMAL, ""
        self.aim, self.motion = self.angles.copy(), Halt()

    def servo(self, pose: Array, half_rise: float) -> bool:
        """Follow a pose; False if there are no joint angles for it."""
        angles = self._solve(pose)
        if angles is None:
            return False
        self.motion = Servo(np.array(pose), half_rise)
        self.aim = angles
        return True

    def press(self, force: Force | None) -> None:
        """Become compliant, or stiff again (None)."""
        if force is not None and self.force is None:
            self._height = self._above(self.pose[:3, 3])
        self.force = force

    @property
    def at_rest(self) -> bool:
        """True if no joint moves."""
        return bool(np.abs(self.speeds).max() < 1e-3)

    def step(self) -> None:
        """Move by a period of the controller."""
        motion = self.motion
        if isinstance(motion, Halt):
            wanted = self._braked(motion)
        elif isinstance(motion, Servo):
            wanted = self._served(motion)
        else:
            wanted = self._driven(motion)
        change = np.clip(
            (wanted - self.speeds) / DT, -JOINT_ACCELERATION, JOINT_ACCELERATION
        )
        self.rates, self.speeds = change, self.speeds + change * DT
        self.angles = self.angles + self.speeds * DT
        self._look()
        if self.force is not None:
            self._comply(self.force)
        self._watch()

    def _braked(self, motion: Halt) -> Array:
        fastest = np.abs(self.speeds).max()
        left = max(fastest - motion.deceleration * DT, 0.0)
        self.contact = 0.0
        return np.asarray(self.speeds * (left / fastest if fastest else 0.0))

    def _served(self, motion: Servo) -> Array:
        rate = HALF_RISE / motion.half_rise
        pull = rate * rate * (self.aim - self.angles) - 2 * rate * self.speeds
        return np.asarray(self.speeds + pull * DT)

    def _comply(self, force: Force) -> None:
        """Move the tool to the height at which the wanted force is felt.

        The force's own loop is taken as ideal: it is as fast as it may be.
        """
        under = self.surface.raised - self._height
        self.contact = STIFFNESS * max(under, 0.0)
        wanted = self.surface.raised - abs(force.newtons) / STIFFNESS
        most = force.speed * DT
        self._height += float(np.clip(wanted - self._height, -most, most))
        way = np.zeros(6)
        off = self._height - self._above(self.pose[:3, 3])
        way[:3] = off * self.surface.normal
        self.angles = self.angles + joint_speeds(self._jacobian, way)
        self._look()

    def _driven(self, motion: Speed | Line) -> Array:
        if isinstance(motion, Speed):
            wanted, most = motion.twist, motion.acceleration
        else:
            way = motion.pose[:3] - self.pose[:3, 3]
            left = float(np.linalg.norm(way))
            if left < 1e-4 and self.at_rest:
                self.motion = Halt()
            ease = float(np.sqrt(motion.acceleration * left))
            top = min(motion.speed, ease, 8.0 * left)
            wanted, most = np.zeros(6), 2.0 * motion.acceleration
            wanted[:3] = way / max(left, 1e-9) * top
            goal, here = pose_of(motion.pose)[:3, :3], self.pose[:3, :3]
            rotated = goal @ here.T
            wanted[3:] = 4.0 * pose_vector(_rotation(rotated))[3:]
        change = wanted - self.twist
        size = float(np.linalg.norm(change[:3]))
        fit = min(1.0, most * DT / size) if size else 1.0
        return np.asarray(joint_speeds(self._jacobian, self.twist + fit * change))

    def _watch(self) -> None:
        """Stop for safety where joints or tool exceed what they may."""
        if self.safety is not Safety.NORMAL:
            return
        if np.abs(self.speeds).max() > JOINT_SPEED:
            self.stop(Safety.PROTECTIVE_STOP, "joint speed")
        elif np.linalg.norm(self.twist[:3]) > self.tool_speed:
            self.stop(Safety.PROTECTIVE_STOP, "tool speed")
        elif (
            isinstance(self.motion, Servo)
            and np.abs(self.aim - self.angles).max() > DEVIATION
        ):
            self.stop(Safety.PROTECTIVE_STOP, "position deviates from its command")
        if self.safety is Safety.NORMAL and isinstance(self.motion, Halt):
            self.aim = self.angles.copy()


def _rotation(matrix: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = matrix
    return pose
