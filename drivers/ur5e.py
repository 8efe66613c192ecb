"""Driver whose simulated paddle has the position of a UR5e's tool."""

from __future__ import annotations

import ipaddress
import time
from pathlib import Path
from typing import Any, Self

import numpy as np

from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import DriverState, Mounting, Robot, RobotConfig
from marl_airhockey.hardware.robot.nominal import nominal_mounting, table_of
from marl_airhockey.hardware.robot.ur5e import PoseReader
from marl_airhockey.toolkit import (
    Array,
    Driver,
    PrescribedMotion,
    RandomStreams,
    Seat,
    View,
)

SILENT = 0.5
"""Time without a message from the arm after which an error is raised, s."""


class Ur5e(Driver):
    """Driver whose simulated paddle has the position of the tool of an arm.

    Without a policy it only measures the arm: a person guides it in freedrive, or
    another process commands it. With a policy, the actions are sent to an emulated arm
    in real time, and the simulated paddle follows the arm. To use a policy on a real
    arm, use ``--backend real``, which also observes the table.

    Args:
        rig: File of a calibrated table, which ``airhockey calibrate`` writes.
        host: Address of the controller without a rig, see ``airhockey ur-emulator``.
        policy: Driver that commands an emulated arm; None to measure only.

    Raises:
        ValueError: There is not exactly one of rig and host, the rig cannot be read, or
            a policy is given for an arm that is not emulated.
    """

    needs_device = True

    def __init__(
        self, rig: str = "", host: str = "", policy: Driver | None = None
    ) -> None:
        if bool(rig) == bool(host):
            raise ValueError(
                "ur5e: expected either a controller, host=127.0.0.5 (airhockey "
                "ur-emulator), or a calibrated table, rig=rig.json"
            )
        self._rig = Rig.load(Path(rig)) if rig else None
        self._host = self._rig.robot if self._rig else host
        self._policy = policy
        if policy is not None:
            self.commands_device, self.observe = True, policy.observe
            self.control_dt, self.trained_in = policy.control_dt, policy.trained_in
            _check_emulated(self._host)
        self._reach: tuple[tuple[float, float], ...] = ()
        self._mounting = self._rig.mounting if self._rig else None
        self._reader: PoseReader | None = None
        self._robot: Robot | None = None
        self._stamp, self._heard, self._due = -1.0, 0.0, 0.0

    def __getstate__(self) -> dict[str, Any]:
        if self._robot is not None:
            raise TypeError("ur5e: an arm that a policy commands cannot be copied")
        return {**self.__dict__, "_reader": None}

    def __enter__(self) -> Self:
        if self._policy is not None:
            self._policy.__enter__()
        return self

    def check(self, observation: Any) -> None:
        if self._policy is not None:
            self._policy.check(observation)

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the memory of the policy; connect to the arm in the first episode.

        Raises:
            ValueError: There is no rig, and the seat is not one of a robot.
        """
        self._reach = seat.reach
        if self._mounting is None:
            self._mounting = nominal_mounting(table_of(seat))
        if self._policy is None:
            return {}
        self._connect_robot()
        return self._policy.reset(seat, rng, worlds)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the action of the policy, which is sent to the arm."""
        assert self._policy is not None
        action, memory = self._policy.act(view, memory)
        robot = self._connect_robot()
        now = time.monotonic()
        if self._due > now:
            time.sleep(self._due - now)
        self._due = max(self._due, now) + view.control_dt
        if robot.state is DriverState.READY:
            robot.enable()
        robot.send_action(action[0] * view.top_speed[0], view.control_dt)
        return action, memory

    @property
    def trouble(self) -> str:
        stopped = (DriverState.HOLD, DriverState.FAULT)
        if self._robot is None or self._robot.state not in stopped:
            return ""
        return f"robot: {self._robot.fault.label}"

    def measured(self) -> PrescribedMotion:
        """Return position and velocity of the tool (1, 4), as the arm reports them.

        Raises:
            RuntimeError: The controller does not respond, or the arm has stopped.
        """
        if self._policy is not None:
            return self._measured_by_driver(self._connect_robot())
        stamp, pose, velocity = self._connect_reader().read()
        now, mounting = time.monotonic(), self._mounting
        if stamp != self._stamp:
            self._stamp, self._heard = stamp, now
        elif now - self._heard > SILENT:
            raise RuntimeError(f"robot at {self._host}: no message for {SILENT} s")
        if mounting is None:
            raise RuntimeError("ur5e: no episode has begun; call reset() first")
        place, way = mounting.to_table(pose), mounting.rotate_to_table(velocity)
        return np.concatenate([place[:2], way[:2]])[None]

    def _measured_by_driver(self, robot: Robot) -> PrescribedMotion:
        now = robot.get_observation()
        if robot.state is DriverState.FAULT or not robot.is_connected:
            raise RuntimeError(f"robot at {self._host}: {robot.fault.label}")
        return np.array([[now.x, now.y, now.vx, now.vy]])

    def _connect_reader(self) -> PoseReader:
        """Return the reader of the arm; a copy of the driver opens its own."""
        if self._reader is None:
            self._reader = PoseReader(self._host)
            self._heard = time.monotonic()
        return self._reader

    def _connect_robot(self) -> Robot:
        if self._robot is None:
            config = (
                self._rig.robot_config(self._reach)
                if self._rig
                else RobotConfig(self._host, _mounted(self._mounting), self._reach)
            )
            robot = Robot(config)
            robot.connect()
            robot.enable()
            self._robot = robot
        return self._robot

    def __exit__(self, *_: object) -> None:
        if self._policy is not None:
            self._policy.__exit__(None, None, None)
        if self._robot is not None:
            self._robot.disconnect()
            self._robot = None
        if self._reader is not None:
            self._reader.close()
            self._reader = None


def _mounted(mounting: Mounting | None) -> Mounting:
    if mounting is None:
        raise RuntimeError("ur5e: no episode has begun; call reset() first")
    return mounting


def _check_emulated(host: str) -> None:
    """Check that a controller is on this machine and therefore emulated.

    Raises:
        ValueError: It is on another machine, so that it may be a real arm.
    """
    try:
        emulated = ipaddress.ip_address(host).is_loopback
    except ValueError:
        emulated = host == "localhost"
    if not emulated:
        raise ValueError(
            f"ur5e: {host} may be a real arm, which a policy cannot move from a "
            "simulated table; use --backend real"
        )


make = Ur5e
