"""Process of the lab's arm: its controller, in real time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from marl_airhockey.hardware.block import Block
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.priority import raise_priority
from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.faults import FAULTS, faults_of
from marl_airhockey.hardware.ur_emulator.motions import Line
from marl_airhockey.hardware.ur_emulator.plant import EmptyTable, PlantReading
from marl_airhockey.hardware.ur_emulator.ports import Ports
from marl_airhockey.types import Array


class PublishedTable(EmptyTable):
    """Table under the arm that reports the paddle to another process.

    Args:
        setup: Setup of the lab.
        block: Memory for time, s, position (3,), m, and velocity (2,), m/s, table
            frame.
    """

    def __init__(self, setup: LabSetup, block: Block) -> None:
        table = setup.make_table()
        super().__init__(table.origin, table.normal)
        self._mounting, self._block = setup.mounting, block

    def __call__(self, pose: Array, velocity: Array) -> PlantReading:
        position = self._mounting.to_table(pose)
        moving = self._mounting.rotate_to_table(velocity)
        self._block.write((time.monotonic(), *position, *moving[:2]))
        return super().__call__(pose, velocity)


def run_arm(setup: LabSetup, memory: Any, pipe: Connection) -> None:
    """Serve an arm and send its address; return when the pipe's other end closes."""
    raise_priority()
    table = PublishedTable(setup, Block(np.frombuffer(memory)))
    controller = Controller(setup.make_arm(table))
    arm, served = controller.arm, Ports(controller)

    def guide(place: list[float]) -> None:
        """Move the arm as if it were guided by hand."""
        arm.motion = Line(setup.mounting.pose(np.array(place)), 0.25, 1.0)

    orders: dict[str, Callable[[Any], None]] = {
        "guide": guide,
        "report": lambda _: None,
        **{name: partial(fault.switch, controller) for name, fault in FAULTS.items()},
    }

    async def serve() -> None:
        """Serve the ports and execute the requests of the pipe."""
        ended = asyncio.Event()

        def obey() -> None:
            try:
                name, value = pipe.recv()
            except (EOFError, OSError):  # The process of the lab has ended.
                ended.set()
                return
            orders[name](value)
            pipe.send(
                {
                    "stopped": arm.stopped,
                    "safety": arm.safety.name,
                    "faults": faults_of(controller),
                }
            )

        ports = asyncio.create_task(served.serve())
        while not ports.done() and not controller.ticks:
            await asyncio.sleep(0.01)
        if not ports.done():
            pipe.send({"host": served.host})
        asyncio.get_running_loop().add_reader(pipe.fileno(), obey)
        waiting = asyncio.create_task(ended.wait())
        await asyncio.wait({ports, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if ports.done():
            pipe.send({"error": str(ports.exception())})
        ports.cancel()

    asyncio.run(serve())
