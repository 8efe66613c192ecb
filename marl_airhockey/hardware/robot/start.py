"""Start of a robot: checks before anything moves, and reasons of failures."""

from __future__ import annotations

import numpy as np

from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.hardware.robot.driver import MISALIGNED
from marl_airhockey.hardware.robot.limits import check_reach, read_limits
from marl_airhockey.hardware.robot.mailbox import Fault, RobotObservation
from marl_airhockey.hardware.robot.supervisor import AWAY, LIFTED
from marl_airhockey.hardware.robot.ur5e import check_controller

EMERGENCY = "robot: emergency stop; release it at the pendant, then start again"


class RobotError(RuntimeError):
    """Error of a robot that does not execute a command."""


def check_arm(config: RobotConfig) -> None:
    """Check a controller, and that no joint reaches its limits in the workspace.

    Raises:
        RobotError: No controller responds, it cannot be used, or a joint would reach
            its limits in the workspace.
    """
    try:
        check_controller(config.host)
        joints = read_limits(config.host)
        check_reach(
            *(joints, config.mounting, np.array(config.tool)),
            *(np.array(config.reach), config.limits.speed),
        )
    except OSError as error:
        raise RobotError(
            f"robot at {config.host}: its state cannot be read: {error}"
        ) from error
    except (RuntimeError, ValueError) as error:
        raise RobotError(str(error)) from error


def start_failure(host: str, now: RobotObservation) -> str:
    """Return why a robot client is not ready after its start, and a remedy.

    Args:
        host: Address of the arm's controller.
        now: Newest observation of the robot client.
    """
    if now.fault == Fault.EMERGENCY_STOP:
        return EMERGENCY
    if now.fault == Fault.NOT_AT_TABLE:
        angle, most = np.degrees(now.misalignment), np.degrees(MISALIGNED)
        return (
            f"robot at {host}: the tool is at x {now.x:+.2f}, y {now.y:+.2f}, z "
            f"{now.z:+.3f} m of the table, turned by {angle:.0f} deg; expected above "
            f"its workspace, z {-LIFTED} to {AWAY} m, turned by at most {most:.0f} "
            "deg; "
            "move it there by hand, or calibrate the mounting again"
        )
    return (
        f"robot at {host}: its control script did not start; does another client "
        "control it?"
    )
