"""Lab: its processes, and the door by which others find it and ask for things."""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.jit.cache import cache_folder
from marl_airhockey.lab.arm_process import run_arm
from marl_airhockey.lab.door import DoorClient, open_door, port_in
from marl_airhockey.lab.faults import ARM_FAULTS, FAULTS
from marl_airhockey.lab.hand_process import path_of, run_hand
from marl_airhockey.lab.setup import LabSetup
from marl_airhockey.lab.table_process import run_table

ANSWER = 5.0
"""Longest time until a process of the lab answers, s"""
START = 300.0
"""Longest time until a lab has started, s: the first time much is compiled"""


def port_file() -> Path:
    """Return the file in which a running lab tells where its door is."""
    return cache_folder() / "lab.json"


class Lab:
    """Lab that runs in processes of its own.

    They end when this one does, however it does.

    Args:
        setup: of the lab.
        seed: of what its table is like.
        frame_rate: pictures a second.
    """

    def __init__(
        self, setup: LabSetup | None = None, seed: int = 0, frame_rate: float = 30.0
    ) -> None:
        self.setup = setup or LabSetup()
        context = multiprocessing.get_context("spawn")
        # Kept, as memory that nobody holds is given to the next who asks.
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
        """Return the next answer of a process.

        Raises:
            RuntimeError: it does not answer, or has failed.
        """
        try:
            answer = pipe.recv() if pipe.poll(seconds) else None
        except EOFError:
            answer = None
        if answer is None or "error" in answer:
            why = answer["error"] if answer else "it does not answer"
            raise RuntimeError(f"lab: {why}")
        return dict(answer)

    def ask(self, order: dict[str, Any]) -> dict[str, Any]:
        """Do what a client asks for and return the answer.

        Raises:
            ValueError: an order that there is not.
        """
        what = order.get("do")
        if what == "info":
            return self._info()
        if what == "survey":
            return self._survey()
        if what == "fault" and order.get("name") not in FAULTS:
            raise ValueError(f"fault {order.get('name')!r}; there are: {[*FAULTS]}")
        with self._lock:
            if what == "fault" and order["name"] in ARM_FAULTS:
                self._arm.send((order["name"], bool(order["on"])))
                return self._expect(self._arm)
            if what == "guide":
                self._arm.send(("guide", order["place"]))
                return self._expect(self._arm)
            if what in ("hand", "hand_camera", "hand_board"):
                return self._move_hand(order)
            if what in ("place", "release", "fault", "truth", "board"):
                self._table.send(order)
                return self._expect(self._table)
        raise ValueError(f"order {what!r} is unknown")

    def _info(self) -> dict[str, Any]:
        return {
            "host": self.host,
            "camera": self.camera_port,
            "table": self.setup.table,
            "pids": [process.pid for process in self._processes],
        }

    def _move_hand(self, order: dict[str, Any]) -> dict[str, Any]:
        """Move the hand, or tell where its camera is; it comes when it is first asked.

        Raises:
            ValueError: a path that there is not.
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
        """Return what a tool that touches the table at twelve places would tell."""
        rng = np.random.default_rng(12)
        low, high = np.min(self.setup.seat.reach, 0), np.max(self.setup.seat.reach, 0)
        places = np.stack(
            np.meshgrid(*np.linspace(low, high, 4).T[:, [0, 1, 3]]), -1
        ).reshape(-1, 2)
        mounting = self.setup.mounting
        touched = [mounting.pose(place)[:3] for place in places]
        noisy = np.array(touched) + rng.normal(0.0, 0.0002, (len(places), 3))
        return {
            "places": places.tolist(),
            "touched": noisy.tolist(),
            "tool": list(mounting.tool),
        }

    @property
    def alive(self) -> list[bool]:
        """True for each process that runs."""
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
    """Open a lab's door on the loopback address; give its port.

    Args:
        lab: whose door it is.
        announce: whether other commands are to find it by the `port_file`.
    """
    with open_door(lab.ask, port_file() if announce else None) as port:
        yield port


class LabClient(DoorClient):
    """Client of a lab that runs in another process.

    Args:
        port: Port of its door.

    Raises:
        OSError: Nobody answers there.
    """

    def __init__(self, port: int) -> None:
        super().__init__(port, "lab")

    @staticmethod
    def find() -> LabClient | None:
        """Return a client of the lab that runs on this machine; None without one."""
        port = port_in(port_file())
        try:
            return None if port is None else LabClient(port)
        except OSError:
            return None


def wait_for_lab(seconds: float = START) -> LabClient:
    """Return a client of a lab that is starting.

    Raises:
        RuntimeError: it does not come up.
    """
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        client = LabClient.find()
        if client is not None:
            return client
        time.sleep(0.05)
    raise RuntimeError("lab: it did not start")
