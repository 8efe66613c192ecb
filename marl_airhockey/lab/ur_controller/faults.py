"""Faults of a controller and its arm, which can be switched on and off."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from marl_airhockey.lab.ur_controller.controller import Controller
from marl_airhockey.lab.ur_controller.plant import EmptyTable
from marl_airhockey.lab.ur_controller.safety import Safety

RAISED = 0.006
"""Height of the body under the paddle, m"""
DELAY = 0.1
"""Delay of delayed packets, s"""
STALL = 0.08
"""Time for which a controller without real time does nothing, twice a second, s"""
LAG = 4.0
"""Factor on the lag of an arm whose look-ahead is too long"""
DRIFT = 6.0
"""Error of a force sensor that drifts, along the base's z, N"""
SLOW = 0.1
"""Fraction to which somebody turns the speed slider"""


class Fault(NamedTuple):
    """Fault."""

    what: str
    """Description of what happens"""
    switch: Callable[[Controller, bool], None]
    """Function that switches it on or off"""
    source: str = ""
    """Public report of the fault on a real arm; "" for a fault of the lab's own list"""


def _protective_stop(controller: Controller, on: bool) -> None:
    if on:
        controller.stop(Safety.PROTECTIVE_STOP, "fault")
    elif controller.arm.safety is Safety.PROTECTIVE_STOP:
        # As if a person at the pendant had unlocked it.
        controller.arm.release()


def _emergency_stop(controller: Controller, on: bool) -> None:
    if on:
        controller.stop(Safety.ROBOT_EMERGENCY_STOP, "fault")
    elif controller.arm.safety is Safety.ROBOT_EMERGENCY_STOP:
        controller.arm.release()


def _silent(controller: Controller, on: bool) -> None:
    controller.silent = on


def _delayed(controller: Controller, on: bool) -> None:
    controller.delay = DELAY if on else 0.0


def _dropped(controller: Controller, on: bool) -> None:
    controller.refuses = on


def _stalled(controller: Controller, on: bool) -> None:
    controller.set_stall(STALL if on else 0.0)


def _raised(controller: Controller, on: bool) -> None:
    plant = controller.arm.plant
    if not isinstance(plant, EmptyTable):
        raise ValueError("puck_under_paddle: this plant has no table to put one on")
    plant.raised = RAISED if on else 0.0


def _slowed(controller: Controller, on: bool) -> None:
    controller.arm.speed_fraction = SLOW if on else 1.0


def _lagging(controller: Controller, on: bool) -> None:
    controller.arm.lag = LAG if on else 1.0


def _drifting(controller: Controller, on: bool) -> None:
    controller.arm.force_drift = np.array([0.0, 0.0, DRIFT if on else 0.0, 0, 0, 0])


def _local(controller: Controller, on: bool) -> None:
    controller.remote = not on


def _powered_off(controller: Controller, on: bool) -> None:
    controller.switch_power(not on)


FAULTS = {
    "protective_stop": Fault("the arm stops as after a collision", _protective_stop),
    "emergency_stop": Fault("somebody presses the red button", _emergency_stop),
    "silent_robot": Fault("the controller sends no more data", _silent),
    "delayed_packets": Fault("data of the controller come 0.1 s late", _delayed),
    "dropped_connection": Fault("RTDE connections are closed, and refused", _dropped),
    "loss_of_real_time": Fault("the controller stalls for 80 ms twice a s", _stalled),
    "puck_under_paddle": Fault("the paddle is lifted by 6 mm", _raised),
    "speed_slider": Fault("somebody turns the speed slider to 10 %", _slowed),
    "local_control": Fault("the pendant is switched to local control", _local),
    "power_off": Fault("the arm has no power; its brakes hold it", _powered_off),
    "servo_lag": Fault(
        "the arm follows four times as late",
        _lagging,
        "Universal_Robots_Client_Library issue 86",
    ),
    "force_drift": Fault(
        "the force sensor reports 6 N too much",
        _drifting,
        "Universal Robots forum 41657",
    ),
}
"""Faults by name"""
