"""Dashboard: the text protocol on port 29999 that operates a controller."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from marl_airhockey.hardware.ur_emulator.controller import Controller

GREETING = "Connected: Universal Robots Dashboard Server"
LOCKED = (
    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of "
    "protective stop before unlocking"
)


class Dashboard:
    """Dashboard of a controller.

    Args:
        controller: Controller that is operated.
        play: Function that starts External Control at the pendant.
    """

    def __init__(self, controller: Controller, play: Callable[[], None]) -> None:
        self._controller, self._start = controller, play
        self._replies: dict[str, Callable[[], str]] = {
            "PolyscopeVersion": self._version,
            "get serial number": lambda: "20200000000",
            "is in remote control": lambda: str(controller.remote).lower(),
            "get robot model": lambda: "UR5",
            "robotmode": self._mode,
            "safetystatus": lambda: f"Safetystatus: {controller.arm.safety.name}",
            "safetymode": lambda: f"Safetymode: {controller.arm.safety.name}",
            "close safety popup": lambda: "closing safety popup",
            "unlock protective stop": self._unlock,
            "stop": self._stop,
            "play": self._play,
            "running": lambda: f"Program running: {str(self._running).lower()}",
            "programState": lambda: (
                f"{'PLAYING' if self._running else 'STOPPED'} rtde_control"
            ),
            "power on": lambda: self._power(True, "Powering on"),
            "power off": lambda: self._power(False, "Powering off"),
            "brake release": lambda: self._power(True, "Brake releasing"),
        }

    @property
    def _running(self) -> bool:
        return self._controller.script.running

    def _version(self) -> str:
        version = ".".join(str(part) for part in self._controller.version)
        return f"URSoftware {version} (Jan 01 2024)"

    def _mode(self) -> str:
        return f"Robotmode: {'RUNNING' if self._controller.powered else 'POWER_OFF'}"

    def _power(self, on: bool, reply: str) -> str:
        self._controller.switch_power(on)
        return reply

    def _unlock(self) -> str:
        return "Protective stop releasing" if self._controller.unlock() else LOCKED

    def _play(self) -> str:
        if not self._controller.ready:
            return "Failed to execute: play"
        self._start()
        return "Starting program"

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
        """Answer a client until it disconnects."""
        try:
            writer.write(f"{GREETING}\n".encode())
            while line := (await reader.readline()).decode(errors="replace").strip():
                if line == "quit":
                    writer.write(b"Disconnected\n")
                    return
                writer.write(f"{self.reply(line)}\n".encode())
                await writer.drain()
        except (ConnectionError, asyncio.CancelledError, ValueError):
            # A line without an end is a ValueError.
            return
        finally:
            writer.close()
