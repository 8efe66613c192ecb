"""Ports of a controller on one loopback address, in real time.

A client cannot choose the ports, so each arm has its own address.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from marl_airhockey.hardware.robot.limits import STATE_PORT
from marl_airhockey.hardware.ur_emulator.arm import DT
from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.dashboard import Dashboard
from marl_airhockey.hardware.ur_emulator.rtde_connection import RtdeConnection
from marl_airhockey.hardware.ur_emulator.state import VERSION_MESSAGE, message, state_of

DASHBOARD, PRIMARY, SECONDARY, SCRIPT, RTDE = 29999, 30001, 30002, 30003, 30004
EXTERNAL_CONTROL = 50002
"""Port of the client from which External Control gets its script."""
HOSTS = tuple(f"127.0.0.{last}" for last in range(1, 30))
"""Addresses for controllers."""
STATE_PERIOD = 0.1
"""Time between two messages of the state, s."""
LATE = 0.25
"""Largest lag of the loop, s; after a larger one, missed periods are skipped."""
BEHIND = 0.006
"""Delay of a period from which on the controller counts as late, s."""
PRESS_PLAY = 0.4
"""Time after which External Control is started, as by a person at the pendant, for a
client that has uploaded no script, s."""
LONGEST_SCRIPT = 1 << 22
"""Largest number of characters of a script; beyond it, its client is disconnected."""
Handler = Callable[
    [asyncio.StreamReader, asyncio.StreamWriter], Coroutine[Any, Any, None]
]


class Ports:
    """Ports of a controller.

    Args:
        controller: Controller that is served.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.host = ""
        """Address at which it is served; "" before."""
        self._clients: set[RtdeConnection] = set()
        self._owners: dict[str, RtdeConnection] = {}
        self._client_host = "127.0.0.1"
        self._tasks: set[asyncio.Task[None]] = set()
        self._handlers: dict[int, Handler] = {
            DASHBOARD: Dashboard(controller, self._press_play).serve,
            RTDE: self._serve_rtde,
            PRIMARY: self._serve_state_and_scripts,
            SECONDARY: self._serve_state_and_scripts,
            SCRIPT: self._serve_scripts,
            STATE_PORT: self._serve_state,
        }

    async def serve(self, hosts: Sequence[str] = HOSTS) -> None:
        """Serve all ports at the first address that is free, until cancelled.

        Args:
            hosts: Addresses to try, in this order.

        Raises:
            RuntimeError: No address is free.
        """
        servers: list[asyncio.Server] = []
        for host in hosts:
            try:
                for port, handler in self._handlers.items():
                    servers.append(await asyncio.start_server(handler, host, port))
            except OSError:  # Used by another lab or another controller.
                _close(servers)
                continue
            self.host = host
            try:
                await self._run()
            finally:
                for task in self._tasks:
                    task.cancel()
                _close(servers)
        what = f"{hosts[0]}: a port" if len(hosts) == 1 else "every loopback address"
        ports = ", ".join(map(str, self._handlers))
        raise RuntimeError(
            f"{what} is taken (the ports are {ports}); is another emulator or lab "
            "still running?"
        )

    async def _run(self) -> None:
        loop, controller = asyncio.get_running_loop(), self.controller
        due = loop.time()
        while True:
            controller.step(behind=loop.time() - due > BEHIND)
            if controller.refuses:
                for client in tuple(self._clients):
                    client.close()
            if self._clients and not (controller.silent or controller.stalled):
                values = controller.values()
                loop.call_later(controller.delay, self._send, controller.ticks, values)
            due += DT
            wait = due - loop.time()
            await asyncio.sleep(max(wait, 0.0))
            if wait < -LATE:
                due = loop.time()

    def _send(self, tick: int, values: dict[str, Any]) -> None:
        for client in tuple(self._clients):
            client.send(tick, values)

    async def _serve_rtde(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        if self.controller.refuses:
            writer.close()
            return
        client = RtdeConnection(
            *(self.controller, reader, writer, self._owners, self._client_started)
        )
        self._clients.add(client)
        try:
            await client.serve()
        finally:
            self._clients.discard(client)

    def _client_started(self, host: str) -> None:
        """Start External Control after a while, if the client uploads no script."""
        self._client_host = host
        self._start(self._press_play_after(PRESS_PLAY))

    async def _press_play_after(self, seconds: float) -> None:
        await asyncio.sleep(seconds)
        if not self.controller.script.running and self.controller.ready:
            await self._fetch_script()

    def _press_play(self) -> None:
        self._start(self._fetch_script())

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _fetch_script(self) -> None:
        """Get a script from the client, as External Control does."""
        address = self._client_host, EXTERNAL_CONTROL
        try:
            reader, writer = await asyncio.open_connection(*address)
        except OSError:  # The client serves no script: it uploads it, or has ended.
            return
        try:
            writer.write(b"request_program\n")
            text = ""
            # The client keeps the connection, so the script ends with a pause.
            while data := await asyncio.wait_for(reader.read(1 << 16), 1.0):
                text += data.decode(errors="replace")
        except (TimeoutError, ConnectionError):
            pass
        finally:
            writer.close()
        self.controller.upload(text)

    async def _serve_scripts(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        text = ""
        try:
            while data := await reader.read(1 << 16):
                text += data.decode(errors="replace")
                if text.rstrip().endswith("end"):
                    self.controller.upload(text)
                    text = ""
                elif len(text) > LONGEST_SCRIPT:
                    return
        except (ConnectionError, asyncio.CancelledError):
            return
        finally:
            writer.close()

    async def _serve_state(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        try:
            writer.write(message(VERSION_MESSAGE, b""))
            while not writer.is_closing():
                writer.write(state_of(self.controller.arm))
                await writer.drain()
                await asyncio.sleep(STATE_PERIOD)
        except (ConnectionError, asyncio.CancelledError):
            return
        finally:
            writer.close()

    async def _serve_state_and_scripts(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        await asyncio.gather(
            self._serve_state(reader, writer), self._serve_scripts(reader, writer)
        )


def _close(servers: list[asyncio.Server]) -> None:
    """Close some servers, so that their ports are free when this returns."""
    for server in servers:
        server.close()
    servers.clear()
