"""Process of the robot client."""

from __future__ import annotations

import os
import signal
from typing import Any

from marl_airhockey.hardware.priority import raise_priority
from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.hardware.robot.driver import ArmDriver
from marl_airhockey.hardware.robot.mailbox import Fault, Mailbox, RobotObservation
from marl_airhockey.hardware.robot.rehearsal import rehearse


def run_driver(config: RobotConfig, memory: Any) -> None:
    """Run until the caller requests the end, or the parent process or the arm is lost.

    Args:
        config: Configuration of the robot.
        memory: Shared memory, see `Mailbox.allocate`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise_priority()
    parent, box = os.getppid(), Mailbox(memory)
    rehearse(config)
    from marl_airhockey.hardware.robot.ur5e import Ur5e

    try:
        arm = Ur5e(config)
    except Exception:
        box.observation = RobotObservation.of_fault(Fault.NOT_CONNECTED)
        raise
    driver = ArmDriver(config, arm, box)
    try:
        while not box.request.closing and os.getppid() == parent:
            driver.cycle()
            if driver.is_over:
                # The threads of ur-rtde would continue, and abort the process later.
                os._exit(1)
            driver.wait()
        driver.close()
    finally:
        arm.close()
