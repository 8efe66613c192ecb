"""Faults of a controller and its arm, which can be switched on and off."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.motions import JointLine
from marl_airhockey.hardware.ur_emulator.plant import EmptyTable
from marl_airhockey.hardware.ur_emulator.safety import Safety
from marl_airhockey.types import Array

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
    is_on: Callable[[Controller], bool]
    """Function that returns True while the controller has the fault, for any reason."""
    source: str = ""
    """Public report of the fault on a real arm; "" for other faults."""


class _Value(NamedTuple):
    """Fault that is a value of an attribute."""

    path: str
    """Dotted name of the attribute in the controller."""
    faulty: Any = True
    """Value of the attribute while the fault is on."""
    normal: Any = False
    """Value of the attribute while the fault is off."""

    def switch(self, controller: Controller, on: bool) -> None:
        """Switch the fault on or off."""
        owner, _, name = self.path.rpartition(".")
        target = attrgetter(owner)(controller) if owner else controller
        setattr(target, name, self.faulty if on else self.normal)

    def is_on(self, controller: Controller) -> bool:
        """Return True while the attribute has the value of the fault."""
        return np.array_equal(attrgetter(self.path)(controller), self.faulty)


def _value_fault(what: str, value: _Value, source: str = "") -> EmulatorFault:
    return EmulatorFault(what, value.switch, value.is_on, source)


def _stop(mode: Safety, controller: Controller, on: bool) -> None:
    if on:
        controller.stop(mode, "fault")
    elif controller.arm.safety is mode:
        # As if a person at the pendant had unlocked it.
        controller.arm.release()


def _is_stopped(mode: Safety, controller: Controller) -> bool:
    return controller.arm.safety is mode


def _stop_fault(what: str, mode: Safety) -> EmulatorFault:
    return EmulatorFault(what, partial(_stop, mode), partial(_is_stopped, mode))


def _stalled(controller: Controller, on: bool) -> None:
    controller.set_stall(STALL if on else 0.0)


def _raised(controller: Controller, on: bool) -> None:
    plant = controller.arm.plant
    if not isinstance(plant, EmptyTable):
        raise ValueError("puck_under_paddle: this plant has no table to put one on")
    plant.raised = RAISED if on else 0.0


def _is_raised(controller: Controller) -> bool:
    plant = controller.arm.plant
    return isinstance(plant, EmptyTable) and plant.raised > 0.0


def _force(along_z: float) -> Array:
    """Return the error (6,) of a force sensor, N and Nm."""
    return np.array([0.0, 0.0, along_z, 0.0, 0.0, 0.0])


def _carried(controller: Controller, on: bool) -> None:
    if on:
        # A person who moves the arm stops its script.
        controller.script.kill()
        moved = controller.arm.angles + np.array([CARRIED, 0, 0, 0, 0, 0])
        controller.arm.motion = JointLine(moved, 0.5, 2.0)


def _powered_off(controller: Controller, on: bool) -> None:
    controller.switch_power(not on)


FAULTS = {
    "protective_stop": _stop_fault(
        "the arm stops as after a collision", Safety.PROTECTIVE_STOP
    ),
    "emergency_stop": _stop_fault(
        "a person presses the emergency stop", Safety.ROBOT_EMERGENCY_STOP
    ),
    "silent_robot": _value_fault("the controller sends no more data", _Value("silent")),
    "delayed_packets": _value_fault(
        "data of the controller arrive 0.1 s late", _Value("delay", DELAY, 0.0)
    ),
    "dropped_connection": _value_fault(
        "RTDE connections are closed, and refused", _Value("refuses")
    ),
    "loss_of_real_time": EmulatorFault(
        "scripts and data stall for 80 ms twice a second",
        _stalled,
        lambda controller: controller.stall > 0.0,
    ),
    "puck_under_paddle": EmulatorFault(
        "the paddle is lifted by 6 mm", _raised, _is_raised
    ),
    "speed_slider": _value_fault(
        "a person turns the speed slider to 10 %",
        _Value("arm.speed_fraction", SLOW, 1.0),
    ),
    "local_control": _value_fault(
        "the pendant is switched to local control", _Value("remote", False, True)
    ),
    "power_off": EmulatorFault(
        "the arm has no power; its brakes hold it",
        _powered_off,
        lambda controller: not controller.powered,
    ),
    "servo_lag": _value_fault(
        "the arm follows with four times the lag",
        _Value("arm.lag", LAG, 1.0),
        "Universal_Robots_Client_Library issue 86",
    ),
    "force_drift": _value_fault(
        "the force sensor reports 6 N too much",
        _Value("arm.force_drift", _force(DRIFT), _force(0.0)),
        "Universal Robots forum 41657",
    ),
    "wrong_payload": _value_fault(
        "the payload at the pendant is 1 kg too low",
        _Value("arm.force_drift", _force(GRAVITY * EXTRA_MASS), _force(0.0)),
        "ros-industrial/universal_robot issue 102",
    ),
    "slider_at_zero": _value_fault(
        "another client moves the speed slider to 0",
        _Value("arm.speed_fraction", 0.0, 1.0),
        "Universal_Robots_ROS_Driver issues 191 and 195",
    ),
    "extrapolated_poses": _value_fault(
        "the controller extrapolates poses that arrive late",
        _Value("script.poses.extrapolates"),
        "Universal_Robots_ROS2_Driver issue 534",
    ),
    "speed_check": _value_fault(
        "a pose that needs a joint above 180 deg/s ends the script",
        _Value("script.poses.checks_speed"),
        "Universal_Robots_Client_Library PR 273",
    ),
    "impatient_program": _value_fault(
        "the script ends after 40 ms without a command",
        _Value("script.longest_silence", IMPATIENT, math.inf),
        "Universal_Robots_Client_Library issue 423",
    ),
    "forgotten_recipes": _value_fault(
        "a client that connects again gets no data",
        _Value("forgets"),
        "Universal_Robots_Client_Library PR 384",
    ),
    "late_state": _value_fault(
        "the first data arrive 1 s after a client has connected",
        _Value("first_after", FIRST_AFTER, 0.0),
        "ur_modern_driver issue 206",
    ),
    "carried_arm": EmulatorFault(
        "a person stops the script and moves the arm away",
        _carried,
        lambda controller: False,  # It has happened and cannot be undone.
        "Universal_Robots_ROS2_Driver issue 800",
    ),
}
"""Faults by name."""


def faults_of(controller: Controller) -> list[str]:
    """Return the names of the faults that a controller has now."""
    return [name for name, fault in FAULTS.items() if fault.is_on(controller)]
