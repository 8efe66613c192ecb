"""Simulated UR5e: its joints, their motions, and safety stops."""

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
"""Period of the controller, s."""
HALF_RISE = 1.678
"""Product of time and frequency at half of a step of a critically damped lag."""
JOINT_SPEED = np.pi
"""Largest speed of a joint, rad/s; the maker specifies 180 degrees per second."""
JOINT_ACCELERATION = 25.0
"""Largest acceleration of a joint in this model, rad/s2."""
DEVIATION = 0.5
"""Distance of a joint from its target beyond which the arm stops, rad."""
FORCE_LIMIT = 150.0
"""Force on the tool beyond which the arm stops, N."""
FORCE_DAMPING = 100.0
"""Force error for each m/s of the compliant axis, Ns/m."""
SCALING_RATE = 4.0
"""Change of the speed scaling per second after the speed slider has moved: 1 to 0 in
0.25 s."""


@dataclass
class EmulatedArm:
    """Arm of six joints, simulated in steps of `DT`.

    Its ``motion`` moves it. A motion that joints cannot follow, or that is too fast for
    the tool, ends in a protective stop, as on the real arm.
    """

    angles: Array
    """Joint angles (6,), rad; given for the start."""
    tool: Array
    """Pose (6,) of the tool's centre, flange frame, m and rad."""
    plant: Plant
    """Model of the objects that the tool touches."""
    tool_speed: float = 1.5
    """Speed of the tool's centre beyond which the arm stops, m/s."""
    motion: Motion = field(default_factory=Halt)
    force: Force | None = None
    safety: Safety = Safety.NORMAL
    stopped: str = ""
    """Cause of the last stop."""
    speed_fraction: float = 1.0
    """Speed slider: fraction of every programmed speed."""
    speed_scaling: float = 1.0
    """Present fraction of programmed speeds, which follows the slider in a ramp."""

    def __post_init__(self) -> None:
        self.speeds = np.zeros(6)
        self.rates = np.zeros(6)
        self.target = self.angles.copy()
        """Target (6,) of the joint angles, rad."""
        self.payload = 0.0
        self._force_zero = np.zeros(6)
        self.force_drift = np.zeros(6)
        """Error (6,) of the force sensor, base frame, N and Nm, a fault."""
        self.lag = 1.0
        """Factor on the lag of `servoL` and `servoJ`, a fault."""
        self._last_scaling = self.speed_scaling
        self.mount(self.tool)

    def mount(self, tool: Array) -> None:
        """Set the tool's centre to a pose (6,), flange frame, m and rad."""
        self.tool, self._tool = tool, pose_of(tool)
        self._off_tool = np.linalg.inv(self._tool)
        self._update_pose()
        self._touch()

    def _update_pose(self) -> None:
        flange, jacobian = forward(self.angles)
        self.pose = flange @ self._tool
        """Pose (4, 4) of the tool's centre, base frame."""
        x, y, z = self.pose[:3, 3] - flange[:3, 3]
        lever = np.array([(0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)])
        jacobian[:3] += lever @ jacobian[3:]
        self._jacobian = jacobian
        self.twist = jacobian @ self.speeds
        """Velocity (6,) of the tool's centre, base frame, m/s and rad/s."""

    def _touch(self) -> None:
        self.reading = self.plant(pose_vector(self.pose), self.twist)

    @property
    def measured_force(self) -> Array:
        """Force and torque (6,) since the sensor was zeroed, base frame, N and Nm."""
        return np.asarray(self.reading.force - self._force_zero + self.force_drift)

    def zero_force_sensor(self) -> None:
        """Zero the force sensor, even in contact, as the real sensor does."""
        self._force_zero = self.reading.force + self.force_drift

    def rehearse(self) -> None:
        """Run every motion on a copy, so that all code is compiled before the start."""
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
        """Return joint angles (6,), rad, for a tool pose; None if there are none.

        Args:
            pose: Pose (6,) of the tool's centre, base frame, m and rad.
            near: Initial angles (6,) of the search, rad; None for the present target.
        """
        if not np.isfinite(pose).all():
            return None
        flange = pose_of(pose) @ self._off_tool
        found, angles = inverse(flange, self.target if near is None else near)
        return angles if found else None

    def stop(self, mode: Safety, why: str) -> None:
        """Stop for safety: brake, and accept no motion until the release."""
        if self.safety is Safety.ROBOT_EMERGENCY_STOP:
            return
        self.safety, self.stopped = mode, why
        self.motion, self.force = Halt(), None

    def release(self) -> None:
        """Accept motions again; the arm rests until one arrives."""
        self.safety, self.stopped = Safety.NORMAL, ""
        self.target, self.motion = self.angles.copy(), Halt()

    def servo(self, pose: Array, half_rise: float) -> bool:
        """Follow a pose (6,); return False if there are no joint angles for it."""
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
        """Advance by one period of the controller."""
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
        """Return the present joint speeds (6,) of a motion, rad/s."""
        if isinstance(motion, Halt):
            fastest = np.abs(self.speeds).max()
            left = max(fastest - motion.deceleration * DT, 0.0)
            return np.asarray(self.speeds * (left / fastest if fastest else 0.0))
        if isinstance(motion, Servo):
            # The time of the control script passes more slowly than the clock.
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
        """Return the part (6,) of the distance to the target along the axis, rad.

        A compliant axis follows no target.
        """
        axis = pose_of(force.frame)[:3, 2]
        aim = (forward(self.target)[0] @ self._tool)[:3, 3]
        twist = np.zeros(6)
        twist[:3] = ((aim - self.pose[:3, 3]) @ axis) * axis
        return np.asarray(joint_speeds(self._jacobian, twist))

    def _compliance(self, force: Force, speeds: Array) -> Array:
        """Return the change of the joint speeds (6,) by which the tool complies.

        Along the compliant axis, only the force error determines the speed of the tool,
        not the motion.
        """
        axis = pose_of(force.frame)[:3, 2]
        error = self.measured_force[:3] @ axis + force.newtons
        speed = float(np.clip(error / FORCE_DAMPING, -force.speed, force.speed))
        twist = np.zeros(6)
        twist[:3] = (speed - (self._jacobian @ speeds)[:3] @ axis) * axis
        return np.asarray(joint_speeds(self._jacobian, twist))

    def _watch(self) -> None:
        """Stop for safety if joints or tool exceed their limits."""
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
