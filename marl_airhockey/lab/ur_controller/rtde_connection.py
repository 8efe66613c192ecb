"""Connection of one client of real-time data exchange (RTDE)."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable
from typing import Any

from marl_airhockey.lab.ur_controller.arm import DT
from marl_airhockey.lab.ur_controller.controller import Controller
from marl_airhockey.lab.ur_controller.rtde import Recipe, package

BACKLOG = 1 << 16
"""Bytes that wait for a slow reader; beyond, packages are dropped, as they are late"""


class RtdeConnection:
    """Connection of one client that exchanges data.

    Args:
        controller: Controller that it writes to.
        reader: Stream from the client.
        writer: Stream to the client.
        started: Function that is called when a client that writes has started.
    """

    def __init__(
        self,
        controller: Controller,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        started: Callable[[str], None],
    ) -> None:
        self._controller, self._reader, self._writer = controller, reader, writer
        self._started = started
        self._inputs: list[Recipe] = []
        self._outputs, self._every = Recipe([]), 1
        self.streams = False
        """True if the client wants data now"""
        version = struct.pack(">4I", *controller.version)
        self._answers: dict[int, Callable[[bytes], bytes]] = {
            ord("V"): lambda body: bytes([struct.unpack(">H", body)[0] in (1, 2)]),
            ord("v"): lambda body: version,
            ord("O"): self._set_outputs,
            ord("I"): self._add_inputs,
            ord("S"): self._start,
            ord("P"): self._pause,
        }

    async def serve(self) -> None:
        """Answer until the client goes."""
        try:
            while True:
                size, kind = struct.unpack(">HB", await self._reader.readexactly(3))
                body = await self._reader.readexactly(size - 3)
                if kind == ord("U"):
                    self._controller.take(self._inputs[body[0] - 1], body[1:])
                elif kind in self._answers:
                    answer = self._answers[kind](body)
                    self._writer.write(package(kind, answer))
        except (
            asyncio.IncompleteReadError,
            asyncio.CancelledError,
            ConnectionError,
        ):
            return
        finally:
            self.streams = False
            self._writer.close()

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()

    def send(self, tick: int, values: dict[str, Any]) -> None:
        """Send the variables, if it is their turn and the client keeps up."""
        waiting = self._writer.transport.get_write_buffer_size()
        if self.streams and tick % self._every == 0 and waiting < BACKLOG:
            body = b"\x01" + self._outputs.pack(values)
            self._writer.write(package(ord("U"), body))

    def _set_outputs(self, body: bytes) -> bytes:
        (rate,) = struct.unpack(">d", body[:8])
        recipe = Recipe.parse(body[8:])
        if recipe.known:
            self._outputs, self._every = recipe, max(round(1.0 / DT / rate), 1)
        return b"\x01" + ",".join(recipe.types).encode()

    def _add_inputs(self, body: bytes) -> bytes:
        self._inputs.append(Recipe.parse(body))
        types = ",".join(self._inputs[-1].types).encode()
        return bytes([len(self._inputs)]) + types

    def _start(self, body: bytes) -> bytes:
        self.streams = True
        if self._inputs:
            self._started(str(self._writer.get_extra_info("peername")[0]))
        return b"\x01"

    def _pause(self, body: bytes) -> bytes:
        self.streams = False
        return b"\x01"
