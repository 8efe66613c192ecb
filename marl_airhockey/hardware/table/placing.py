"""Placement of paddle and puck on a real table between two episodes."""

from __future__ import annotations

import time

import numpy as np

from marl_airhockey.hardware.robot import DriverState, Fault
from marl_airhockey.hardware.table.devices import TableDevices
from marl_airhockey.hardware.table.operator import make_operator
from marl_airhockey.hardware.vision import Sighting
from marl_airhockey.hardware.vision.watcher import Watcher
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array

FIRST = 3
"""Number of sightings for the first estimate."""
SEEN_AGAIN = 2.0
"""Longest time from a puck's release until its `FIRST` sightings, s."""
PLACING = 30.0
"""Longest time until a placed puck is seen, s."""
APART = 0.08
"""Largest accepted distance of a placed puck from its target position, m."""


class Placing:
    """Placement of paddle and puck, by the robot and an operator.

    Args:
        devices: Devices of the table.
        scene: Scene on the table.
    """

    def __init__(self, devices: TableDevices, scene: Scene) -> None:
        self._devices, self._scene = devices, scene
        self.operator = make_operator(devices.rig.operator)
        """Operator, who places the puck and allows the arm to move."""
        self._allowed = False
        self.seen_block: Sighting | None = None
        """Sighting of the placed block; None without one."""

    def place(self, state: State) -> list[Sighting]:
        """Set up the state in which an episode begins. Afterwards the robot is ready.

        Args:
            state: State of one world, with arrays (1, ...).

        Returns:
            First sightings of the puck after its release; none without a puck. Those
            of the block are in `seen_block`.

        Raises:
            RobotError: The robot does not recover, or does not reach its position.
            RuntimeError: Puck or block is not seen, or not at its start position.
        """
        robot = self._devices.robot
        if not self._allowed:
            reach = self._scene.seats[0].reach
            self.operator.begin(self._devices.rig.motion_words(reach))
            self._allowed = True
        self._ready_robot()
        robot.go_to(state.paddle[0, 0])
        if not self._scene.pucks:
            return []
        target, velocity = state.puck[0, 0], state.puck_velocity[0, 0]
        watcher, block = self._devices.block_watcher, None
        if watcher is not None:
            block = state.block[0, 0]
        self.operator.place(target, velocity, block)
        self._await("puck", self._devices.watcher, target)
        if watcher is not None and block is not None:
            self.seen_block = self._await("block", watcher, block)
            watcher.take()
        self.operator.release()
        return self._first_sightings()

    def _ready_robot(self) -> None:
        """Recover a robot that has stopped, after the operator has allowed it.

        Raises:
            RobotError: The robot does not recover.
        """
        robot = self._devices.robot
        while robot.state is DriverState.FAULT or not robot.is_connected:
            self.operator.allow(robot.fault.label)
            if robot.fault is Fault.EMERGENCY_STOP:
                # A person must release it at the pendant, or `connect` fails.
                robot.disconnect()
                robot.connect()
            else:
                robot.recover()

    def _await(self, body: str, watcher: Watcher, target: Array) -> Sighting:
        """Wait until a placed body is seen near its target position (2,), m.

        Raises:
            RuntimeError: The body is not seen there in time.
        """
        devices, far = self._devices, float("inf")
        began = time.monotonic()
        until = began + PLACING
        while time.monotonic() < until:
            devices.robot.send_action(np.zeros(2), 0.0)
            last = watcher.last
            if last is not None and last.taken > began:
                far = float(np.linalg.norm(last.place - target))
                if far < APART:
                    return last
            time.sleep(0.02)
        trouble = devices.camera.trouble or watcher.trouble
        where = "not seen" if not np.isfinite(far) else f"seen {far:.2f} m from there"
        raise RuntimeError(
            f"the {body} is {where} within {PLACING:.0f} s (target "
            f"{np.round(target, 2)} m); "
            f"{trouble or 'put it at its target'}"
        )

    def _first_sightings(self) -> list[Sighting]:
        """Return the first sightings of a puck that was just released.

        Raises:
            RuntimeError: The puck is not seen often enough.
        """
        devices = self._devices
        devices.watcher.take()
        seen: list[Sighting] = []
        until = time.monotonic() + SEEN_AGAIN
        while len(seen) < FIRST and time.monotonic() < until:
            devices.robot.send_action(np.zeros(2), 0.0)
            time.sleep(0.005)
            seen += devices.watcher.take()
        if len(seen) < FIRST:
            raise RuntimeError("the puck was not seen after its release")
        return seen
