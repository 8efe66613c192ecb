"""Arm: the joints of a simulated UR5e, what moves them, and what stops them."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np

from marl_airhockey.hardware.robot.kinematics import (
    forward,
    inverse,
    joint_speeds,
    pose_of,
    pose_vector,
)
from marl_airhockey.hardware.ur_emulator.motions import (
    Force,
    Halt,
    JointLine,
    JointSpeed,
    Line,
    Motion,
    Servo,
    Speed,
)
from marl_airhockey.hardware.ur_emulator.plant import Plant
from marl_airhockey.hardware.ur_emulator.safety import Safety
from marl_airhockey.types import Array

DT = 0.002
"""Period of the controller, s"""
HALF_RISE = 1.678
"""Time times frequency at which a critically damped lag is half-way"""
JOINT_SPEED = np.pi
"""Largest speed of a joint, rad/s: the maker's 180 degrees a second"""
JOINT_ACCELERATION = 25.0
"""Largest acceleration of a joint that the model's drives give, rad/s2"""
DEVIATION = 0.5
"""Distance of a joint from its target that is a fault, rad"""
FORCE_LIMIT = 150.0
"""Force on the tool beyond which the arm stops, N"""
FORCE_DAMPING = 100.0
"""Force error for each m/s of the compliant axis, Ns/m"""
SCALING_RATE = 4.0
"""Change of the speed scaling per second after the speed slider has moved: 1 to 0 in
0.25 s"""


@dataclass
class EmulatedArm:
    """Arm of six joints, moved by a step of `DT`.

    What moves it is its ``motion``; a motion that joints cannot follow, or that is too
    fast for the tool, ends in a protective stop, as on the real one.
    """

    angles: Array
    """(6,) rad, at the start"""
    tool: Array
    """(6,) pose of the tool's centre in the flange's frame"""
    plant: Plant
    """Model of the objects that the tool touches"""
    tool_speed: float = 1.5
    """Speed of the tool's centre beyond which the arm stops, m/s"""
    motion: Motion = field(default_factory=Halt)
    force: Force | None = None
    safety: Safety = Safety.NORMAL
    stopped: str = ""
    """Cause of the last stop"""
    speed_fraction: float = 1.0
    """Speed slider: fraction of every programmed speed"""
    speed_scaling: float = 1.0
    """Fraction of every programmed speed now: it follows the slider in a ramp"""

    def __post_init__(self) -> None:
        self.speeds = np.zeros(6)
        self.rates = np.zeros(6)
        self.target = self.angles.copy()
        """(6,) joint angles that the motion aims at"""
        self.payload = 0.0
        self._force_zero = np.zeros(6)
        self.force_drift = np.zeros(6)
        """(6,) error of the force sensor, base frame, N and Nm, a fault"""
        self.lag = 1.0
        """Factor on the lag of `servoL` and `servoJ`, a fault"""
        self._last_scaling = self.speed_scaling
        self.mount(self.tool)

    def mount(self, tool: Array) -> None:
        """Set the tool's centre to a pose (6,) in the flange's frame."""
        self.tool, self._tool = tool, pose_of(tool)
        self._off_tool = np.linalg.inv(self._tool)
        self._update_pose()
        self._touch()

    def _update_pose(self) -> None:
        flange, jacobian = forward(self.angles)
        self.pose = flange @ self._tool
        """(4, 4) of the tool's centre, base frame"""
        x, y, z = self.pose[:3, 3] - flange[:3, 3]
        lever = np.array([(0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)])
        jacobian[:3] += lever @ jacobian[3:]
        self._jacobian = jacobian
        self.twist = jacobian @ self.speeds
        """(6,) m/s and rad/s of the tool's centre"""

    def _touch(self) -> None:
        self.reading = self.plant(pose_vector(self.pose), self.twist)

    @property
    def measured_force(self) -> Array:
        """(6,) N and Nm, relative to when the sensor was zeroed, base frame."""
        return np.asarray(self.reading.force - self._force_zero + self.force_drift)

    def zero_force_sensor(self) -> None:
        """Take the present force as zero, a contact's too, as the real sensor does."""
        self._force_zero = self.reading.force + self.force_drift

    def rehearse(self) -> None:
        """Make every motion on a copy, so that all is compiled before time counts."""
        plant, self.plant = self.plant, lambda pose, velocity: self.reading
        twin, pose = deepcopy(self), pose_vector(self.pose)
        self.plant = plant
        twin.press(Force(pose, 1.0, 0.1))
        twin.servo(pose, 0.1)
        for motion in (
            *(twin.motion, Speed(np.zeros(6), 1.0), Line(pose, 0.1, 1.0)),
            JointLine(self.angles, 0.1, 1.0),
        ):
            twin.motion = motion
            twin.step()

    def solve(self, pose: Array, near: Array | None = None) -> Array | None:
        """Return joint angles that give the tool a pose (6,); None without any.

        Args:
            pose: (6,) base frame.
            near: (6,) angles where the search begins; None for the present target.
        """
        if not np.isfinite(pose).all():
            return None
        flange = pose_of(pose) @ self._off_tool
        found, angles = inverse(flange, self.target if near is None else near)
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
        self.target, self.motion = self.angles.copy(), Halt()

    def servo(self, pose: Array, half_rise: float) -> bool:
        """Follow a pose; False if there are no joint angles for it."""
        angles = self.solve(pose)
        if angles is not None:
            self.servo_joints(angles, half_rise)
        return angles is not None

    def servo_joints(self, angles: Array, half_rise: float) -> None:
        """Follow joint angles (6,), rad."""
        self.motion, self.target = Servo(angles, half_rise), angles

    def press(self, force: Force | None) -> None:
        """Become compliant, or stiff again (None)."""
        self.force = force

    @property
    def at_rest(self) -> bool:
        """True if no joint moves."""
        return bool(np.abs(self.speeds).max() < 1e-3)

    def step(self) -> None:
        """Move by a period of the controller."""
        most = SCALING_RATE * DT
        self._last_scaling = self.speed_scaling
        change = self.speed_fraction - self.speed_scaling
        self.speed_scaling += min(max(change, -most), most)
        goal = self._goal_speeds(self.motion)
        if self.force is not None:
            goal = goal + self._compliance(self.force, goal)
        rates = (goal - self.speeds) / DT
        fastest = float(np.abs(rates).max())
        self.rates = rates * min(1.0, JOINT_ACCELERATION / max(fastest, 1.0))
        self.speeds = self.speeds + self.rates * DT
        self.angles = self.angles + self.speeds * DT
        self._update_pose()
        self._touch()
        self._watch()

    def _goal_speeds(self, motion: Motion) -> Array:
        """Return the joint speeds (6,) that a motion calls for now, rad/s."""
        if isinstance(motion, Halt):
            fastest = np.abs(self.speeds).max()
            left = max(fastest - motion.deceleration * DT, 0.0)
            return np.asarray(self.speeds * (left / fastest if fastest else 0.0))
        if isinstance(motion, Servo):
            # The program's time passes more slowly than the clock.
            rate, scale = HALF_RISE / (self.lag * motion.half_rise), self.speed_scaling
            if min(scale, self._last_scaling) < 1e-6:
                return np.zeros(6)
            own, away = self.speeds / self._last_scaling, self.target - self.angles
            if self.force is not None:
                away = away - self._along_axis(self.force)
            pull = rate * rate * away - 2 * rate * own
            return np.asarray(scale * (own + pull * scale * DT))
        if isinstance(motion, JointSpeed):
            change = self.speed_scaling * motion.speeds - self.speeds
            most = motion.acceleration * DT
            return np.asarray(self.speeds + np.clip(change, -most, most))
        if isinstance(motion, JointLine):
            return self._joint_line(motion)
        return self._tool_speeds(motion)

    def _joint_line(self, motion: JointLine) -> Array:
        way = motion.angles - self.angles
        left = float(np.abs(way).max())
        if left < 1e-4 and self.at_rest:
            self.motion = Halt()
        ease = float(np.sqrt(motion.acceleration * left))
        top = min(motion.speed * self.speed_scaling, ease, 8.0 * left)
        change = way / max(left, 1e-9) * top - self.speeds
        most = 2.0 * motion.acceleration * DT
        return np.asarray(self.speeds + np.clip(change, -most, most))

    def _tool_speeds(self, motion: Speed | Line) -> Array:
        if isinstance(motion, Speed):
            goal, most = self.speed_scaling * motion.twist, motion.acceleration
        else:
            way = motion.pose[:3] - self.pose[:3, 3]
            left = float(np.linalg.norm(way))
            if left < 1e-4 and self.at_rest:
                self.motion = Halt()
            ease = float(np.sqrt(motion.acceleration * left))
            top = min(motion.speed * self.speed_scaling, ease, 8.0 * left)
            goal, most = np.zeros(6), 2.0 * motion.acceleration
            goal[:3] = way / max(left, 1e-9) * top
            rotated = np.eye(4)
            rotated[:3, :3] = pose_of(motion.pose)[:3, :3] @ self.pose[:3, :3].T
            goal[3:] = 4.0 * pose_vector(rotated)[3:]
        change = goal - self.twist
        size = float(np.linalg.norm(change[:3]))
        fit = min(1.0, most * DT / size) if size else 1.0
        return np.asarray(joint_speeds(self._jacobian, self.twist + fit * change))

    def _along_axis(self, force: Force) -> Array:
        """Return the part (6,) of the way to the target that is along the axis, rad.

        A compliant axis follows no target.
        """
        axis = pose_of(force.frame)[:3, 2]
        aim = (forward(self.target)[0] @ self._tool)[:3, 3]
        twist = np.zeros(6)
        twist[:3] = ((aim - self.pose[:3, 3]) @ axis) * axis
        return np.asarray(joint_speeds(self._jacobian, twist))

    def _compliance(self, force: Force, speeds: Array) -> Array:
        """Return the change of the joint speeds (6,) by which the tool complies.

        Along the compliant axis the tool moves as fast as the force error says,
        whatever the motion calls for.
        """
        axis = pose_of(force.frame)[:3, 2]
        error = self.measured_force[:3] @ axis + force.newtons
        speed = float(np.clip(error / FORCE_DAMPING, -force.speed, force.speed))
        twist = np.zeros(6)
        twist[:3] = (speed - (self._jacobian @ speeds)[:3] @ axis) * axis
        return np.asarray(joint_speeds(self._jacobian, twist))

    def _watch(self) -> None:
        """Stop for safety where joints or tool exceed what they may."""
        if self.safety is not Safety.NORMAL:
            return
        if np.abs(self.speeds).max() > JOINT_SPEED:
            self.stop(Safety.PROTECTIVE_STOP, "joint speed")
        elif np.linalg.norm(self.twist[:3]) > self.tool_speed:
            self.stop(Safety.PROTECTIVE_STOP, "tool speed")
        elif np.linalg.norm(self.reading.force[:3]) > FORCE_LIMIT:
            self.stop(Safety.PROTECTIVE_STOP, "force")
        elif (
            isinstance(self.motion, Servo)
            and np.abs(self.target - self.angles).max() > DEVIATION
        ):
            self.stop(Safety.PROTECTIVE_STOP, "position deviates from its command")
        if self.safety is Safety.NORMAL and not isinstance(self.motion, Servo):
            self.target = self.angles.copy()
