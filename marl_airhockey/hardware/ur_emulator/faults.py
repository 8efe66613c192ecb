"""Faults of a controller and its arm, which can be switched on and off."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.motions import JointLine
from marl_airhockey.hardware.ur_emulator.plant import EmptyTable
from marl_airhockey.hardware.ur_emulator.safety import Safety

RAISED = 0.006
"""Height of the body under the paddle, m."""
DELAY = 0.1
"""Delay of delayed packets, s."""
STALL = 0.08
"""Time for which a controller without real time does nothing, twice a second, s."""
EXTRA_MASS, GRAVITY = 1.0, 9.81
"""Mass that is missing in the pendant's payload, kg, and gravity, m/s2."""
IMPATIENT = 0.04
"""Time without a command after which an impatient script ends, s."""
FIRST_AFTER = 1.0
"""Time until the first data of a controller with a delayed state, s."""
CARRIED = 0.3
"""Angle by which a person turns the base of the arm, rad."""
LAG = 4.0
"""Factor on the lag of an arm whose look-ahead is too long."""
DRIFT = 6.0
"""Error of a force sensor that drifts, along the base's z, N."""
SLOW = 0.1
"""Fraction to which a person turns the speed slider."""


class EmulatorFault(NamedTuple):
    """Fault of a controller or its arm."""

    what: str
    """Description of the fault."""
    switch: Callable[[Controller, bool], None]
    """Function that switches the fault on or off."""
    source: str = ""
    """Public report of the fault on a real arm; "" for other faults."""


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


def _overweight(controller: Controller, on: bool) -> None:
    weight = GRAVITY * EXTRA_MASS if on else 0.0
    controller.arm.force_drift = np.array([0.0, 0.0, weight, 0, 0, 0])


def _stopped_slider(controller: Controller, on: bool) -> None:
    controller.arm.speed_fraction = 0.0 if on else 1.0


def _extrapolated(controller: Controller, on: bool) -> None:
    controller.script.poses.extrapolates = on


def _checked(controller: Controller, on: bool) -> None:
    controller.script.poses.checks_speed = on


def _impatient(controller: Controller, on: bool) -> None:
    controller.script.longest_silence = IMPATIENT if on else math.inf


def _forgetful(controller: Controller, on: bool) -> None:
    controller.forgets = on


def _late_state(controller: Controller, on: bool) -> None:
    controller.first_after = FIRST_AFTER if on else 0.0


def _carried(controller: Controller, on: bool) -> None:
    if on:
        # A person who moves the arm stops its script.
        controller.script.kill()
        moved = controller.arm.angles + np.array([CARRIED, 0, 0, 0, 0, 0])
        controller.arm.motion = JointLine(moved, 0.5, 2.0)


def _local(controller: Controller, on: bool) -> None:
    controller.remote = not on


def _powered_off(controller: Controller, on: bool) -> None:
    controller.switch_power(not on)


FAULTS = {
    "protective_stop": EmulatorFault(
        "the arm stops as after a collision", _protective_stop
    ),
    "emergency_stop": EmulatorFault(
        "a person presses the emergency stop", _emergency_stop
    ),
    "silent_robot": EmulatorFault("the controller sends no more data", _silent),
    "delayed_packets": EmulatorFault(
        "data of the controller arrive 0.1 s late", _delayed
    ),
    "dropped_connection": EmulatorFault(
        "RTDE connections are closed, and refused", _dropped
    ),
    "loss_of_real_time": EmulatorFault(
        "scripts and data stall for 80 ms twice a second", _stalled
    ),
    "puck_under_paddle": EmulatorFault("the paddle is lifted by 6 mm", _raised),
    "speed_slider": EmulatorFault("a person turns the speed slider to 10 %", _slowed),
    "local_control": EmulatorFault("the pendant is switched to local control", _local),
    "power_off": EmulatorFault(
        "the arm has no power; its brakes hold it", _powered_off
    ),
    "servo_lag": EmulatorFault(
        "the arm follows with four times the lag",
        _lagging,
        "Universal_Robots_Client_Library issue 86",
    ),
    "force_drift": EmulatorFault(
        "the force sensor reports 6 N too much",
        _drifting,
        "Universal Robots forum 41657",
    ),
    "wrong_payload": EmulatorFault(
        "the payload at the pendant is 1 kg too low",
        _overweight,
        "ros-industrial/universal_robot issue 102",
    ),
    "slider_at_zero": EmulatorFault(
        "another client moves the speed slider to 0",
        _stopped_slider,
        "Universal_Robots_ROS_Driver issues 191 and 195",
    ),
    "extrapolated_poses": EmulatorFault(
        "the controller extrapolates poses that arrive late",
        _extrapolated,
        "Universal_Robots_ROS2_Driver issue 534",
    ),
    "speed_check": EmulatorFault(
        "a pose that needs a joint above 180 deg/s ends the script",
        _checked,
        "Universal_Robots_Client_Library PR 273",
    ),
    "impatient_program": EmulatorFault(
        "the script ends after 40 ms without a command",
        _impatient,
        "Universal_Robots_Client_Library issue 423",
    ),
    "forgotten_recipes": EmulatorFault(
        "a client that connects again gets no data",
        _forgetful,
        "Universal_Robots_Client_Library PR 384",
    ),
    "late_state": EmulatorFault(
        "the first data arrive 1 s after a client has connected",
        _late_state,
        "ur_modern_driver issue 206",
    ),
    "carried_arm": EmulatorFault(
        "a person stops the script and moves the arm away",
        _carried,
        "Universal_Robots_ROS2_Driver issue 800",
    ),
}
"""Faults by name."""
