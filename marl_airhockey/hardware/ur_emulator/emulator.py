"""Emulator of a controller at an address, with faults at set times or on request."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.hardware.lab.door import open_door
from marl_airhockey.hardware.ur_emulator.controller import VERSION, Controller
from marl_airhockey.hardware.ur_emulator.faults import FAULTS
from marl_airhockey.hardware.ur_emulator.ports import Ports
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.jit.folders import cache_folder

SCHEDULED = re.compile(r"(\w+)@([\d.]+)s?(?:-([\d.]+)s?)?")
"""Pattern of a scheduled fault: NAME@BEGIN or NAME@BEGIN-END, s."""


class ScheduledFault(NamedTuple):
    """Fault at a set time."""

    name: str
    begin: float
    """Time after the start, s."""
    end: float | None
    """Time after the start at which it is switched off, s; None for never."""

    @staticmethod
    def parse(text: str) -> ScheduledFault:
        """Return the fault of a text such as ``silent_robot@3s`` or ``..@3s-5s``.

        Raises:
            ValueError: The text has another form, or the fault is unknown.
        """
        found = SCHEDULED.fullmatch(text)
        if not found:
            raise ValueError(f"fault {text!r}: expected NAME@3s or NAME@3s-5s")
        name, begin, end = found.groups()
        if name not in FAULTS:
            raise ValueError(unknown_name("fault", name, FAULTS))
        if end is not None and float(end) <= float(begin):
            raise ValueError(f"fault {text!r}: it must end after it begins")
        return ScheduledFault(name, float(begin), float(end) if end else None)


def parse_version(text: str) -> tuple[int, int, int, int]:
    """Return the version of a text such as ``5.12.2``, with the emulated build.

    Raises:
        ValueError: The text has another form.
    """
    if not re.fullmatch(r"\d+\.\d+\.\d+", text):
        raise ValueError(f"--polyscope: {text!r}; expected a version such as 5.12.2")
    major, minor, bugfix = (int(part) for part in text.split("."))
    return major, minor, bugfix, VERSION[3]


def door_file(address: str) -> Path:
    """Return the file in which other commands find the emulator at an address."""
    return cache_folder() / f"ur-emulator-{address}.json"


def status_of(controller: Controller) -> dict[str, Any]:
    """Return the present state of a controller, for a person or a test."""
    arm, script = controller.arm, controller.script
    return {
        "safety": arm.safety.name,
        "stopped": arm.stopped,
        "program": "running" if script.running else "stopped",
        "uploads": controller.uploads,
        "pose": [round(float(x), 5) for x in arm.reading.pose],
        "speed": round(float(np.linalg.norm(arm.twist[:3])), 5),
        "force": round(float(np.linalg.norm(arm.reading.force[:3])), 2),
        "commands": {str(k): n for k, n in sorted(script.counts.items())},
    }


async def serve_emulator(
    controller: Controller,
    address: str,
    schedule: Sequence[ScheduledFault] = (),
    ready: Callable[[], None] = lambda: None,
) -> None:
    """Serve a controller at an address until cancelled.

    Args:
        controller: Controller with its arm.
        address: Loopback address.
        schedule: Faults at set times.
        ready: Function that is called once clients can connect.

    Raises:
        RuntimeError: A port of the address is in use.
    """
    loop = asyncio.get_running_loop()

    async def switch(name: str, on: bool) -> dict[str, Any]:
        FAULTS[name].switch(controller, on)
        return status_of(controller)

    async def report() -> dict[str, Any]:
        return status_of(controller)

    def answer(order: dict[str, Any]) -> dict[str, Any]:
        name, work = order.get("name"), report()
        if order.get("do") == "fault":
            work.close()
            if name not in FAULTS:
                raise ValueError(unknown_name("fault", name, FAULTS))
            work = switch(name, bool(order["on"]))
        return asyncio.run_coroutine_threadsafe(work, loop).result(5.0)

    async def follow(fault: ScheduledFault) -> None:
        await asyncio.sleep(fault.begin)
        await switch(fault.name, True)
        if fault.end is not None:
            await asyncio.sleep(fault.end - fault.begin)
            await switch(fault.name, False)

    serving = asyncio.create_task(Ports(controller).serve([address]))
    waiting = [asyncio.create_task(follow(fault)) for fault in schedule]
    try:
        while not (controller.ticks or serving.done()):
            await asyncio.sleep(0.01)
        if serving.done():
            # The file may be that of the emulator that uses the ports.
            return await serving
        with open_door(answer, door_file(address)):
            ready()
            await serving
    finally:
        for task in (serving, *waiting):
            task.cancel()
