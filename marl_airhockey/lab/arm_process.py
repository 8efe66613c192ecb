"""Process of the lab's arm: its controller, in real time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from marl_airhockey.devices.block import Block
from marl_airhockey.devices.priority import raise_priority
from marl_airhockey.devices.robot.kinematics import pose_vector
from marl_airhockey.lab.setup import LabSetup
from marl_airhockey.lab.ur_controller.arm import Line
from marl_airhockey.lab.ur_controller.faults import FAULTS
from marl_airhockey.lab.ur_controller.server import Controller


def run_arm(setup: LabSetup, memory: Any, pipe: Connection) -> None:
    """Serve an arm, tell its address, and go on until the pipe's other end closes."""
    raise_priority()
    block, mounting = Block(np.frombuffer(memory)), setup.mounting

    def publish(controller: Controller) -> None:
        """Tell the table where the paddle is."""
        arm = controller.arm
        place = mounting.to_table(pose_vector(arm.pose))
        velocity = mounting.rotate_to_table(arm.twist[:3])
        block.write((time.monotonic(), *place, *velocity[:2]))

    controller = Controller(setup.make_arm(), publish)
    arm = controller.arm

    def guide(place: list[float]) -> None:
        """Move as somebody guides the arm by hand."""
        arm.motion = Line(mounting.pose(np.array(place)), 0.25, 1.0)

    orders: dict[str, Callable[[Any], None]] = {
        "guide": guide,
        **{name: partial(fault.switch, controller) for name, fault in FAULTS.items()},
    }

    async def serve() -> None:
        """Serve the ports and obey the pipe."""
        ended = asyncio.Event()

        def obey() -> None:
            try:
                name, value = pipe.recv()
            except (EOFError, OSError):  # Whoever opened the lab is gone.
                ended.set()
                return
            orders[name](value)
            pipe.send({"stopped": arm.stopped, "safety": arm.safety.name})

        ports = asyncio.create_task(controller.serve())
        while not ports.done() and not controller.ticks:
            await asyncio.sleep(0.01)
        if not ports.done():
            pipe.send({"host": controller.host})
        asyncio.get_running_loop().add_reader(pipe.fileno(), obey)
        waiting = asyncio.create_task(ended.wait())
        await asyncio.wait({ports, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if ports.done():
            pipe.send({"error": str(ports.exception())})
        ports.cancel()

    asyncio.run(serve())
