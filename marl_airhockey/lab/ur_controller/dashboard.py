"""Dashboard: lines of text on port 29999 by which a controller is looked after."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from marl_airhockey.lab.ur_controller.arm import Safety

if TYPE_CHECKING:
    from marl_airhockey.lab.ur_controller.server import Controller

GREETING = "Connected: Universal Robots Dashboard Server"
UNLOCK_AFTER = 5.0
"""Time that a protective stop lasts at least, s, as the real dashboard says"""
LOCKED = (
    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of "
    "protective stop before unlocking"
)


class Dashboard:
    """Dashboard of a controller.

    Args:
        controller: what it looks after.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._since = 0.0
        self._replies: dict[str, Callable[[], str]] = {
            "PolyscopeVersion": lambda: "URSoftware 5.12.2.1101534 (Jan 01 2024)",
            "get serial number": lambda: "20200000000",
            "is in remote control": lambda: "true",
            "get robot model": lambda: "UR5",
            "robotmode": lambda: "Robotmode: RUNNING",
            "safetystatus": lambda: f"Safetystatus: {self._safety}",
            "safetymode": lambda: f"Safetymode: {self._safety}",
            "close safety popup": lambda: "closing safety popup",
            "unlock protective stop": self._unlock,
            "stop": self._stop,
            "play": lambda: "Starting program",
            "running": lambda: f"Program running: {str(self._running).lower()}",
            "programState": lambda: (
                f"{'PLAYING' if self._running else 'STOPPED'} rtde_control"
            ),
            "power on": lambda: "Powering on",
            "brake release": lambda: "Brake releasing",
        }

    @property
    def _safety(self) -> str:
        return self._controller.arm.safety.name

    @property
    def _running(self) -> bool:
        return self._controller.script.running

    def note_stop(self) -> None:
        """Count the time of a protective stop from now on."""
        self._since = time.monotonic()

    def _unlock(self) -> str:
        arm = self._controller.arm
        if arm.safety is Safety.PROTECTIVE_STOP:
            if time.monotonic() - self._since < UNLOCK_AFTER:
                return LOCKED
            arm.release()
        return "Protective stop releasing"

    def _stop(self) -> str:
        self._controller.script.kill()
        return "Stopped"

    def reply(self, line: str) -> str:
        """Return the answer to a line."""
        answer = self._replies.get(line)
        return answer() if answer else f"could not understand: '{line}'"

    async def serve(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Answer a client until it goes."""
        try:
            writer.write(f"{GREETING}\n".encode())
            while line := (await reader.readline()).decode(errors="replace").strip():
                if line == "quit":
                    writer.write(b"Disconnected\n")
                    return
                writer.write(f"{self.reply(line)}\n".encode())
        except (ConnectionError, asyncio.CancelledError):
            return
        finally:
            writer.close()
