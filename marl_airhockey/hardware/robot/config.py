"""Configuration of a robot: pose of its table and limits of its motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from marl_airhockey.hardware.robot.filters import Smoothing
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.hardware.robot.shaper import MotionLimits
from marl_airhockey.sim.core.checks import check_fields

PAYLOADS = 0.0, 5.0
"""Range of the mass that a UR5e may carry, kg."""
FULL_ROTATION = 2.0 * np.pi
"""Largest component of a rotation vector, rad."""
SHARE = 0.7
"""Largest fraction of the pendant's limits that motion may use."""


@dataclass(frozen=True)
class Pendant:
    """Limits that are set at the robot's pendant, which software cannot change.

    A controller does not report them, so a person copies them from the pendant.
    """

    speed: float = 1.5
    """Speed of the tool, m/s."""
    force: float = 150.0
    """Force on the tool, N."""

    def __post_init__(self) -> None:
        check_fields(self, speed=(0.01, 10), force=(1, 500))


def check_tool(tool: tuple[float, ...]) -> None:
    """Check the pose of the paddle in the flange frame.

    Raises:
        ValueError: It is not a pose (6,), or a number is too large.
    """
    if (
        len(tool) != 6
        or max(map(abs, tool[:3])) > 1.0
        or max(map(abs, tool[3:])) > FULL_ROTATION
    ):
        raise ValueError(
            f"tool: {tool}; expected x, y, z, at most 1 m each, and a rotation vector, "
            "rad"
        )


def check_polygon(reach: tuple[tuple[float, float], ...]) -> None:
    """Check that a workspace is a convex polygon.

    Raises:
        ValueError: It is not convex, or it has fewer than three corners.
    """
    corners = np.array(reach)
    if len(corners) < 3:
        raise ValueError(f"reach: {len(corners)} corners; expected at least 3")
    edges = np.roll(corners, -1, 0) - corners
    after = np.roll(edges, -1, 0)
    if (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]).min() < 0.0:
        raise ValueError("reach: expected a convex polygon, counter-clockwise")


def check_pendant(limits: MotionLimits, pendant: Pendant) -> None:
    """Check that the speed limit is at most `SHARE` of the pendant's.

    Raises:
        ValueError: The limit is higher.
    """
    if limits.speed > SHARE * pendant.speed:
        raise ValueError(
            f"limits.speed: {limits.speed} m/s is above {SHARE:.0%} of the pendant's "
            f"{pendant.speed} m/s; lower it, or let the person responsible for the "
            "robot raise the pendant's"
        )


@dataclass(frozen=True)
class ServoSettings:
    """Settings of the control loops in the controller."""

    look_ahead: float = 0.05
    """Look-ahead time of `servoL`, s; a longer time is smoother and adds latency."""
    gain: float = 300.0
    """Gain of the position loop of `servoL`."""
    force: float = 5.0
    """Force with which the paddle is pressed on the table, N."""
    compliance: float = 0.15
    """Largest speed of the compliant axis, m/s."""
    lag: float = 0.068
    """Usual lag of an arm behind the poses that it is sent, s."""
    deviation: float = 0.026
    """Largest distance of an arm from its expected position, as the time in which the
    paddle covers it at its speed limit, s. From half of this distance on, the sent
    poses move more slowly. The emulated arm needs 0.013 s."""

    def __post_init__(self) -> None:
        # look_ahead and gain: ranges that the controller accepts.
        check_fields(
            self,
            look_ahead=(0.03, 0.2),
            gain=(100, 2000),
            force=(0, 50),
            compliance=(0.001, 2),
            lag=(0.001, 5),
            deviation=(0.001, 5),
        )


@dataclass(frozen=True)
class RobotConfig:
    """Configuration of a robot client.

    Raises:
        ValueError: A field has the wrong type or is outside its range, the workspace is
            not a convex polygon, or the speed limit is too high for the pendant's.
    """

    host: str
    """Address of the arm's controller."""
    mounting: Mounting
    reach: tuple[tuple[float, float], ...]
    """Workspace, a convex polygon, counter-clockwise, table frame, m."""
    limits: MotionLimits = field(default_factory=MotionLimits)
    tool: tuple[float, ...] = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
    """Pose of the paddle's foot, flange frame, m and rad."""
    payload: float = 0.6
    """Mass of the paddle and its holder, kg."""
    smoothing: Smoothing = field(default_factory=Smoothing)
    """Filter of the commands, before the shaper."""
    servo: ServoSettings = field(default_factory=ServoSettings)
    pendant: Pendant = field(default_factory=Pendant)

    def __post_init__(self) -> None:
        check_fields(self, reach=(-3, 3), payload=PAYLOADS)
        check_tool(self.tool)
        check_polygon(self.reach)
        check_pendant(self.limits, self.pendant)


@dataclass(frozen=True)
class Preset:
    """Limits and settings that belong together."""

    limits: MotionLimits = field(default_factory=MotionLimits)
    servo: ServoSettings = field(default_factory=ServoSettings)
    pendant: Pendant = field(default_factory=Pendant)


PRESETS = {
    "ur5e": Preset(),
    # Constants of the robot code of the paper's authors: steps of 0.26 m in 50 ms
    # without other limits, as the speed and acceleration limits in `servoL` have no
    # effect. They are for comparison with an emulator: `Robot.connect` rejects them for
    # every arm.
    "authors": Preset(
        MotionLimits(speed=5.2, acceleration=500.0, jerk=1e6),
        ServoSettings(look_ahead=0.2, gain=700.0, compliance=1.5, deviation=2.0),
        Pendant(speed=7.5),
    ),
}
"""Presets by name."""
