"""Process of a robot's driver."""

from __future__ import annotations

import os
import signal
from typing import Any

from marl_airhockey.devices.priority import raise_priority
from marl_airhockey.devices.robot.config import DriverConfig
from marl_airhockey.devices.robot.driver import Driver
from marl_airhockey.devices.robot.mailbox import Fault, Mailbox, RobotObservation
from marl_airhockey.devices.robot.rehearsal import rehearse


def run_driver(config: DriverConfig, memory: Any) -> None:
    """Run until the mailbox says closing, the parent process is gone or the arm lost.

    Args:
        config: Configuration of the driver.
        memory: Memory of its mailbox.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise_priority()
    parent, box = os.getppid(), Mailbox(memory)
    rehearse(config)
    from marl_airhockey.devices.robot.ur5e import Ur5e

    try:
        arm = Ur5e(config)
    except Exception:
        box.observation = RobotObservation.of_fault(Fault.NOT_CONNECTED)
        raise
    driver = Driver(config, arm, box)
    try:
        while not box.request.closing and os.getppid() == parent:
            driver.cycle()
            if driver.is_over:
                # The client's threads would go on, and abort in their own way.
                os._exit(1)
            driver.wait()
        driver.close()
    finally:
        arm.close()
