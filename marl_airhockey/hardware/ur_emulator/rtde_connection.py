"""Connection of one client of real-time data exchange (RTDE).

Invalid data from a client affects only its own connection.
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable
from typing import Any

from marl_airhockey.hardware.ur_emulator.arm import DT
from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.rtde import (
    INPUTS,
    OUTPUTS,
    TAKEN,
    Recipe,
    package,
    text_message,
)

BACKLOG = 1 << 16
"""Largest number of bytes that wait for a slow reader; beyond it, packages, which would
be late, are dropped."""
RATES = 1.0, 1.0 / DT
"""Least and largest rate of data that a client may request, Hz."""
OLD_RATE = 125.0
"""Rate of a client of version 1, which cannot choose one, Hz."""
HEADER = 3
"""Number of bytes of the size and the type of a package."""


class RtdeConnection:
    """Connection of one client that exchanges data.

    Args:
        controller: Controller that receives the inputs.
        reader: Stream from the client.
        writer: Stream to the client.
        owners: Connection that writes each input, by the input's name.
        started: Function that is called when a client that writes has started.
    """

    def __init__(
        self,
        controller: Controller,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        owners: dict[str, RtdeConnection],
        started: Callable[[str], None],
    ) -> None:
        self._controller, self._reader, self._writer = controller, reader, writer
        self._owners, self._started = owners, started
        self._inputs: list[Recipe] = []
        self._outputs, self._every = Recipe(b"", OUTPUTS), 1
        self._version, self._refused, self._from = 1, False, 0.0
        self.streams = False
        """True while the client requests data."""
        version = struct.pack(">4I", *controller.version)
        self._answers: dict[int, Callable[[bytes], bytes]] = {
            ord("V"): self._set_version,
            ord("v"): lambda body: version,
            ord("O"): self._set_outputs,
            ord("I"): self._add_inputs,
            ord("S"): self._start,
            ord("P"): self._pause,
        }

    async def serve(self) -> None:
        """Answer until the client disconnects, or sends an invalid package."""
        try:
            while True:
                size, kind = struct.unpack(
                    ">HB", await self._reader.readexactly(HEADER)
                )
                if size < HEADER:
                    raise ValueError(f"size {size}; expected at least {HEADER}")
                self._take(kind, await self._reader.readexactly(size - HEADER))
        except (ValueError, struct.error) as error:
            self._report(f"package refused: {error}")
        except (
            asyncio.IncompleteReadError,
            asyncio.CancelledError,
            ConnectionError,
        ):
            return
        finally:
            self.streams = False
            for name in [n for n, owner in self._owners.items() if owner is self]:
                del self._owners[name]
            self._writer.close()

    def _take(self, kind: int, body: bytes) -> None:
        """Answer a package.

        Raises:
            ValueError: The package is malformed.
            struct.error: The body has another length.
        """
        if kind in self._answers:
            self._writer.write(package(kind, self._answers[kind](body)))
        elif kind != ord("U"):
            raise ValueError(f"type {kind} is unknown")
        elif not body or not 1 <= body[0] <= len(self._inputs):
            raise ValueError("data of an unknown recipe")
        else:
            self._controller.take(self._inputs[body[0] - 1].unpack(body[1:]))

    def _report(self, text: str) -> None:
        self._writer.write(text_message(text))

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()

    def send(self, tick: int, values: dict[str, Any]) -> None:
        """Send the variables if they are due and the client is fast enough."""
        waiting = self._writer.transport.get_write_buffer_size()
        ready = self.streams and self._controller.time >= self._from
        if ready and tick % self._every == 0 and waiting < BACKLOG:
            number = b"\x01" if self._version == 2 else b""
            self._writer.write(package(ord("U"), number + self._outputs.pack(values)))

    def _set_version(self, body: bytes) -> bytes:
        (wanted,) = struct.unpack(">H", body)
        known = wanted in (1, 2)
        self._version = wanted if known else self._version
        return bytes([known])

    def _set_outputs(self, body: bytes) -> bytes:
        rate, names = OLD_RATE, body
        if self._version == 2:
            (rate,), names = struct.unpack(">d", body[:8]), body[8:]
        recipe = Recipe(names, OUTPUTS)
        in_range = RATES[0] <= rate <= RATES[1]
        if not in_range:
            self._report(f"output rate {rate} Hz; expected {RATES[0]} to {RATES[1]}")
        self._refused = not (recipe.known and in_range)
        if not self._refused:
            self._outputs, self._every = recipe, max(round(1.0 / DT / rate), 1)
        types = ",".join(recipe.types).encode()
        return types if self._version == 1 else bytes([not self._refused]) + types

    def _add_inputs(self, body: bytes) -> bytes:
        recipe = Recipe(body, INPUTS)
        types = [
            TAKEN if self._owners.get(name, self) is not self else kind
            for name, kind in zip(recipe.names, recipe.types, strict=True)
        ]
        answer = ",".join(types).encode()
        if not recipe.known or TAKEN in types:
            return b"\x00" + answer
        self._owners.update(dict.fromkeys(recipe.names, self))
        self._inputs.append(recipe)
        return bytes([len(self._inputs)]) + answer

    def _start(self, body: bytes) -> bytes:
        self.streams = not (self._refused or self._controller.forgets)
        self._from = self._controller.time + self._controller.first_after
        if not self._refused and self._inputs:
            self._started(str(self._writer.get_extra_info("peername")[0]))
        return bytes([not self._refused])

    def _pause(self, body: bytes) -> bytes:
        self.streams = False
        return b"\x01"
