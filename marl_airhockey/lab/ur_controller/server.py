"""Controller's ports: dashboard, script and real-time data, on one loopback address.

A client cannot choose the ports, so each arm has an address of its own.
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable, Coroutine, Sequence
from sys import stderr
from typing import Any

import numpy as np

from marl_airhockey.devices.robot.kinematics import pose_vector
from marl_airhockey.devices.robot.limits import STATE_PORT
from marl_airhockey.lab.ur_controller.arm import DT, SAFETY_BITS, Arm, Safety
from marl_airhockey.lab.ur_controller.dashboard import Dashboard
from marl_airhockey.lab.ur_controller.rtde import Recipe, package
from marl_airhockey.lab.ur_controller.script import ControlScript
from marl_airhockey.lab.ur_controller.state import VERSION_MESSAGE, message, state_of

DASHBOARD, RTDE = 29999, 30004
SCRIPTS = (30001, 30002, 30003)
"""Ports that take scripts"""
HOSTS = tuple(f"127.0.0.{last}" for last in range(1, 30))
"""Addresses of controllers"""
VERSION = (5, 12, 2, 1101534)
"""Version that the controller says it has"""
STATE_PERIOD = 0.1
"""Time between two messages of the state, s"""
STOPPED, PLAYING = 1, 2
"""Runtime states"""
BACKLOG = 1 << 16
"""Bytes that wait for a slow reader; beyond, packages are dropped, as they are late"""
LATE = 0.25
"""Time by which the loop may lag before it gives up what it missed, s"""
BEHIND = 0.006
"""Delay of a period from which on the controller counts as late, s"""
STALL_EVERY = 250
"""Periods from one stall to the next, a fault"""
SPACING = 4
"""Periods between two commands of a client that sends 125 a second"""
Handler = Callable[
    [asyncio.StreamReader, asyncio.StreamWriter], Coroutine[Any, Any, None]
]
Publish = Callable[["Controller"], None]


class Controller:
    """Controller of an arm: its safety, its script and its clients.

    Args:
        arm: what it controls.
        publish: called in every period, after the arm has moved.
    """

    def __init__(self, arm: Arm, publish: Publish = lambda controller: None) -> None:
        self.arm, self.script = arm, ControlScript(arm)
        self.dashboard = Dashboard(self)
        arm.rehearse()
        self.clients: set[RtdeConnection] = set()
        self.ticks = 0
        self.host = ""
        """Address at which it is served; "" before"""
        self._ports: dict[int, Handler] = {
            DASHBOARD: self.dashboard.serve,
            RTDE: self._serve_rtde,
            **dict.fromkeys(SCRIPTS, self._serve_script),
            STATE_PORT: self._serve_state,
        }
        self.silent = False
        """True if no data is sent, a fault"""
        self.delay = 0.0
        """Time by which data is sent late, a fault, s"""
        self.stall = 0.0
        """Time for which the controller does nothing twice a second, a fault, s"""
        self._refuses = False
        self._publish = publish
        self._pending: list[tuple[Recipe, bytes]] = []

    def upload(self, text: str) -> None:
        """Run a script that a client has sent."""
        if self.arm.safety is Safety.NORMAL and "def rtde_control" in text:
            self.script.start()

    def refuse(self, on: bool) -> None:
        """Close all RTDE connections and refuse new ones, or accept them again."""
        self._refuses = on
        for client in tuple(self.clients) if on else ():
            client.close()

    def take(self, recipe: Recipe, body: bytes) -> None:
        """Keep what a client has written for the next period."""
        self._pending.append((recipe, body))

    def step(self, behind: bool = False) -> None:
        """Go on by a period: inputs, script, arm, safety.

        Args:
            behind: whether the clock is ahead, as this process was not served in time.
        """
        self.ticks += 1
        # All that came in a period is latched at its end: the last one counts. A real
        # controller is never late; what piled up while this one was is taken as it
        # came, or the arm would be told to leap.
        count = len(self._pending) if not behind else int(self.ticks % SPACING == 0)
        for recipe, body in self._pending[:count]:
            self._write(recipe.unpack(body))
        del self._pending[:count]
        self.script.step()
        safe = self.arm.safety
        self.arm.step()
        if self.arm.safety is not Safety.NORMAL:
            self.script.kill()
            if safe is Safety.NORMAL:
                self.dashboard.note_stop()
                print(f"lab: {self.arm.safety.name}: {self.arm.stopped}", file=stderr)
        self._publish(self)

    def _write(self, values: dict[str, Any]) -> None:
        for name, value in values.items():
            kind, _, index = name.rpartition("_")
            if kind == "input_int_register":
                self.script.inputs_int[int(index)] = value
                if index == "0":
                    self.script.silence = 0.0
            elif kind == "input_double_register":
                self.script.inputs_double[int(index)] = value

    def values(self) -> dict[str, Any]:
        """Return the variables that clients can read, by name."""
        arm, script = self.arm, self.script
        pose = pose_vector(arm.pose)
        force = np.zeros(6)
        force[:3] = arm.contact * arm.surface.normal
        ints, doubles = script.outputs_int, script.outputs_double
        return {
            "timestamp": self.ticks * DT,
            "actual_q": arm.angles,
            "target_q": arm.aim,
            "actual_qd": arm.speeds,
            "target_qd": arm.speeds,
            "target_qdd": arm.rates,
            "actual_TCP_pose": pose,
            "target_TCP_pose": pose,
            "actual_TCP_speed": arm.twist,
            "target_TCP_speed": arm.twist,
            "actual_TCP_force": force,
            "runtime_state": PLAYING if script.running else STOPPED,
            "robot_status_bits": 1 | (2 if script.running else 0) | 8,
            "safety_status_bits": SAFETY_BITS[arm.safety],
            "safety_mode": int(arm.safety),
            "robot_mode": 7,
            "speed_scaling": 1.0,
            "target_speed_fraction": 1.0,
            "speed_slider_fraction": 1.0,
            "payload": arm.payload,
            **{f"output_int_register_{i}": ints[i] for i in range(24)},
            **{f"output_double_register_{i}": doubles[i] for i in range(24)},
        }

    async def serve(self, hosts: Sequence[str] = HOSTS) -> None:
        """Serve all ports at the first address that is free, until cancelled.

        Args:
            hosts: Addresses to try, in this order.

        Raises:
            RuntimeError: There is none.
        """
        servers: list[asyncio.Server] = []
        for host in hosts:
            try:
                for port, handler in self._ports.items():
                    servers.append(await asyncio.start_server(handler, host, port))
            except OSError:  # Another lab's, or another controller's.
                _close(servers)
                continue
            self.host = host
            try:
                await self._run()
            finally:
                _close(servers)
        what = f"{hosts[0]}: a port" if len(hosts) == 1 else "every loopback address"
        raise RuntimeError(
            f"{what} is taken (the ports are {', '.join(map(str, self._ports))}); is "
            "another emulator or lab still running?"
        )

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            self.step(behind=loop.time() - due > BEHIND)
            if self.clients and not self.silent:
                loop.call_later(self.delay, self._send, self.ticks, self.values())
            if self.stall and self.ticks % STALL_EVERY == 0:
                await asyncio.sleep(self.stall)
            due += DT
            wait = due - loop.time()
            await asyncio.sleep(max(wait, 0.0))
            if wait < -LATE:
                due = loop.time()

    def _send(self, tick: int, values: dict[str, Any]) -> None:
        for client in tuple(self.clients):
            client.send(tick, values)

    async def _serve_script(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        text = ""
        try:
            while data := await reader.read(1 << 16):
                text += data.decode(errors="replace")
                if text.rstrip().endswith("end"):
                    self.upload(text)
                    text = ""
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
                writer.write(state_of(self.arm))
                await writer.drain()
                await asyncio.sleep(STATE_PERIOD)
        except (ConnectionError, asyncio.CancelledError):
            return
        finally:
            writer.close()

    async def _serve_rtde(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        if self._refuses:
            writer.close()
            return
        await RtdeConnection(self, reader, writer).serve()


def _close(servers: list[asyncio.Server]) -> None:
    """Close some servers, so that their ports are free when this returns."""
    for server in servers:
        server.close()
    servers.clear()


class RtdeConnection:
    """Connection of one client that exchanges data."""

    def __init__(
        self,
        controller: Controller,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        self._controller, self._reader, self._writer = controller, reader, writer
        self._inputs: list[Recipe] = []
        self._outputs, self._every = Recipe([]), 1
        self._answers: dict[int, Callable[[bytes], bytes]] = {
            ord("V"): self._agree,
            ord("v"): lambda body: struct.pack(">4I", *VERSION),
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
            self._controller.clients.discard(self)
            self._writer.close()

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()

    def send(self, tick: int, values: dict[str, Any]) -> None:
        """Send the variables, if it is their turn and the client keeps up."""
        waiting = self._writer.transport.get_write_buffer_size()
        if tick % self._every == 0 and waiting < BACKLOG:
            body = b"\x01" + self._outputs.pack(values)
            self._writer.write(package(ord("U"), body))

    def _agree(self, body: bytes) -> bytes:
        return bytes([struct.unpack(">H", body)[0] in (1, 2)])

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
        self._controller.clients.add(self)
        return b"\x01"

    def _pause(self, body: bytes) -> bytes:
        self._controller.clients.discard(self)
        return b"\x01"
