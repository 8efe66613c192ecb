"""Processes of the virtual lab, and the RPC server for requests of other processes."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.hardware.lab.arm_process import run_arm
from marl_airhockey.hardware.lab.door import DoorClient, open_door, port_in
from marl_airhockey.hardware.lab.faults import ARM_FAULTS, FAULTS
from marl_airhockey.hardware.lab.hand_process import path_of, run_hand
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_process import run_table
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.jit.folders import cache_folder

ANSWER = 5.0
"""Longest time until a process of the lab responds, s."""
START = 300.0
"""Longest time until a lab has started, s; the first start compiles its backend."""


def port_file() -> Path:
    """Return the file in which a running lab writes the port of its RPC server."""
    return cache_folder() / "lab.json"


class Lab:
    """Lab that runs in its own processes.

    They end when this process ends, even if it is killed.

    Args:
        setup: Setup of the lab; None for the default.
        seed: Seed of the table's physics parameters.
        frame_rate: Frame rate of the cameras, 1/s.

    Raises:
        RuntimeError: The extra ``hardware`` is not installed, or a process does not
            start.
    """

    def __init__(
        self, setup: LabSetup | None = None, seed: int = 0, frame_rate: float = 30.0
    ) -> None:
        # Checked here, as an error in a process would print a traceback.
        require("scipy", "hardware")
        self.setup = setup or LabSetup()
        context = multiprocessing.get_context("spawn")
        # Stored here, as memory without a reference is freed and used again.
        self._memory = memory = context.Array("d", 7, lock=False)
        self._lock = threading.Lock()
        self._frame_rate, self._seed = frame_rate, seed
        self._hand: Connection | None = None
        self._hand_port = 0
        self._arm, arm_end = context.Pipe()
        self._table, table_end = context.Pipe()
        shared = self.setup, seed, frame_rate, memory, table_end
        self._processes = [
            context.Process(target=run_arm, args=(self.setup, memory, arm_end)),
            context.Process(target=run_table, args=shared),
        ]
        for process in self._processes:
            process.start()
        arm_end.close()
        table_end.close()
        self.host = str(self._expect(self._arm, START)["host"])
        self.camera_port = int(self._expect(self._table, START)["port"])

    def _expect(self, pipe: Connection, seconds: float = ANSWER) -> dict[str, Any]:
        """Return the next response of a process.

        Raises:
            RuntimeError: The process does not respond, or has failed.
        """
        try:
            answer = pipe.recv() if pipe.poll(seconds) else None
        except EOFError:
            answer = None
        if answer is None or "error" in answer:
            why = answer["error"] if answer else "its process does not answer"
            raise RuntimeError(f"lab: {why}")
        return dict(answer)

    def ask(self, order: dict[str, Any]) -> dict[str, Any]:
        """Execute a request of a client and return the response.

        The response to {"do": "faults"} is {"on": NAMES}, the faults that the lab has
        now. A protective stop that was unlocked is not one of them.

        Raises:
            ValueError: The request or the fault is unknown, or the path is invalid.
            RuntimeError: A process does not respond.
        """
        what = order.get("do")
        if what == "info":
            return self._info()
        if what == "survey":
            return self._survey()
        if what == "fault" and order.get("name") not in FAULTS:
            raise ValueError(
                f"fault {order.get('name')!r}: expected one of {[*FAULTS]}"
            )
        with self._lock:
            if what == "fault" and order["name"] in ARM_FAULTS:
                self._arm.send((order["name"], bool(order["on"])))
                return self._expect(self._arm)
            if what == "faults":
                self._arm.send(("report", None))
                names = self._expect(self._arm)["faults"]
                self._table.send({"do": "truth"})
                return {"on": [*names, *self._expect(self._table)["faults"]]}
            if what == "guide":
                self._arm.send(("guide", order["place"]))
                return self._expect(self._arm)
            if what in ("hand", "hand_camera", "hand_board"):
                return self._move_hand(order)
            if what in ("place", "release", "fault", "truth", "board"):
                self._table.send(order)
                return self._expect(self._table)
        raise ValueError(f"request {what!r} is unknown")

    def _info(self) -> dict[str, Any]:
        return {
            "host": self.host,
            "camera": self.camera_port,
            "table": self.setup.table,
            "marked": self.setup.marked,
            "block": self.setup.block,
            "frame_rate": self._frame_rate,
            "pids": [process.pid for process in self._processes],
        }

    def _move_hand(self, order: dict[str, Any]) -> dict[str, Any]:
        """Move the hand and return its camera's port; start its process if needed.

        Raises:
            ValueError: The path is invalid.
        """
        if order["do"] == "hand":
            path_of(order)
        if self._hand is None:
            context = multiprocessing.get_context("spawn")
            self._hand, end = context.Pipe()
            arguments = self.setup, self._frame_rate, self._seed, end
            process = context.Process(target=run_hand, args=arguments)
            process.start()
            end.close()
            self._processes.append(process)
            self._hand_port = int(self._expect(self._hand, START)["port"])
        self._hand.send(order)
        return {**self._expect(self._hand), "camera": self._hand_port}

    def _survey(self) -> dict[str, Any]:
        """Return the noisy poses of a tool that touches the table at twelve points."""
        rng = np.random.default_rng(12)
        low, high = np.min(self.setup.seat.reach, 0), np.max(self.setup.seat.reach, 0)
        points = np.stack(
            np.meshgrid(*np.linspace(low, high, 4).T[:, [0, 1, 3]]), -1
        ).reshape(-1, 2)
        mounting = self.setup.mounting
        touched = [mounting.pose(point)[:3] for point in points]
        noisy = np.array(touched) + rng.normal(0.0, 0.0002, (len(points), 3))
        return {
            "places": points.tolist(),
            "touched": noisy.tolist(),
            "tool": list(mounting.tool),
        }

    @property
    def alive(self) -> list[bool]:
        """True for each running process."""
        return [process.is_alive() for process in self._processes]

    def close(self) -> None:
        """End all processes."""
        for pipe in (self._arm, self._table, self._hand):
            if pipe is not None:
                pipe.close()
        for process in self._processes:
            process.join(2.0)
            if process.is_alive():
                process.kill()
                process.join()

    def __enter__(self) -> Lab:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def served(lab: Lab, announce: bool = True) -> Iterator[int]:
    """Start a lab's RPC server on the loopback address and yield its port.

    Args:
        lab: Lab that executes the requests.
        announce: True to write the `port_file`, with which other commands find the lab.
    """
    with open_door(lab.ask, port_file() if announce else None) as port:
        yield port


class LabClient(DoorClient):
    """Client of a lab that runs in another process.

    Args:
        port: Port of the lab's RPC server.

    Raises:
        OSError: No lab listens at the port.
    """

    def __init__(self, port: int) -> None:
        super().__init__(port, "lab")

    @staticmethod
    def find() -> LabClient | None:
        """Return a client of the lab that runs on this machine; None without a lab."""
        port = port_in(port_file())
        try:
            return None if port is None else LabClient(port)
        except OSError:
            return None
