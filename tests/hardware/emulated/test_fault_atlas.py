"""Every fault of a controller against the driver: what holds whatever goes wrong."""

import re
from pathlib import Path

import numpy as np
import pytest

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.robot import (
    DriverState,
    Fault,
)
from marl_airhockey.hardware.robot.supervisor import OFF_TABLE
from marl_airhockey.hardware.ur_emulator.faults import FAULTS
from marl_airhockey.hardware.ur_emulator.safety import Safety

STEP = 0.05
REPORTED = [name for name, fault in FAULTS.items() if fault.source]
OF_CONNECTIONS = ("forgotten_recipes", "late_state")
"""Faults that only a client over the network meets"""


class Run:
    """Run of a robot to and fro, with what must hold at every moment.

    Args:
        seed: Seed of the times and of the driver's stalls.
    """

    def __init__(self, seed):
        self.robot, self.rng = EmulatedRobot(), np.random.default_rng(seed)
        self.top = self.depth = 0.0
        assert self.robot.drive_to(self.robot.setup.home)
        self.drive(1.2, 0.0)

    def drive(self, seconds, speed=0.5, stalls=False):
        """Command a speed along y, to and fro, m/s."""
        robot, home = self.robot, np.asarray(self.robot.setup.home)
        up = 1.0
        for _ in range(round(seconds / STEP)):
            y = robot.true_position[1] - home[1]
            up = -np.sign(y) if abs(y) > 0.2 else up
            robot.send_action(np.array([0.0, up * speed]), STEP)
            robot.driver_runs = not (stalls and self.rng.random() < 0.3)
            for _ in range(25):
                robot.advance(0.002)
                velocity = np.linalg.norm(robot.true_velocity)
                if robot.controller.script.running:
                    self.top = max(self.top, float(velocity))
                    self.depth = max(self.depth, abs(robot.true_position[2]))
        robot.driver_runs = True


@pytest.mark.parametrize("stalls", [False, True])
@pytest.mark.parametrize("name", [n for n in FAULTS if n not in OF_CONNECTIONS])
def test_no_fault_makes_the_paddle_fast_or_keeps_it_moving(name, stalls):
    run = Run(len(name))
    robot = run.robot
    run.drive(0.5 + run.rng.uniform(0.0, 0.3), stalls=stalls)
    robot.switch(name)
    run.drive(1.5, stalls=stalls)
    robot.disable()
    # An arm at a tenth of its speed needs ten times as long.
    robot.advance(1.0 if name != "speed_slider" else 3.0)
    rests = robot.true_position
    robot.advance(1.0)
    if name != "carried_arm":
        np.testing.assert_allclose(robot.true_position, rests, atol=1e-3)
    robot.switch(name, False)
    robot.advance(1.0)
    robot.enable()
    run.drive(1.0)
    assert run.top <= 1.02 * robot.config.limits.speed
    assert run.depth < OFF_TABLE


EXPECTED = {
    "servo_lag": (DriverState.HOLD, Fault.DEVIATION),
    "force_drift": (DriverState.HOLD, Fault.PADDLE_LIFTED),
    "wrong_payload": (DriverState.HOLD, Fault.PADDLE_LIFTED),
    "slider_at_zero": (DriverState.RUNNING, Fault.NONE),
    "extrapolated_poses": (DriverState.RUNNING, Fault.NONE),
    "speed_check": (DriverState.RUNNING, Fault.NONE),
    "impatient_program": (DriverState.RUNNING, Fault.NONE),
    "carried_arm": (DriverState.FAULT, Fault.PROGRAM_LOST),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_a_reported_fault_has_the_documented_reaction(name):
    run = Run(0)
    run.drive(0.5)
    run.robot.switch(name)
    run.drive(2.0)
    assert (run.robot.state, run.robot.fault) == EXPECTED[name]
    assert run.robot.controller.arm.safety is Safety.NORMAL


def test_an_arm_that_was_carried_away_is_not_driven_back():
    run = Run(0)
    run.robot.switch("carried_arm")
    run.robot.advance(2.0)
    before = run.robot.true_position
    run.robot.recover()
    run.robot.advance(1.0)
    np.testing.assert_allclose(run.robot.true_position, before, atol=1e-3)
    assert run.robot.fault in (Fault.PROGRAM_LOST, Fault.NONE)


def test_a_robot_that_is_ready_keeps_its_program_alive():
    robot = EmulatedRobot()
    robot.switch("impatient_program")
    robot.advance(10.0)
    assert robot.state is DriverState.READY
    assert robot.controller.script.running


def test_every_reported_fault_is_in_the_docs():
    page = Path("docs/robot_results.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \|", page, re.MULTILINE)
    shown = {name: source.strip() for name, _, source in rows}
    assert {name: FAULTS[name].source for name in REPORTED} == {
        name: shown.get(name) for name in REPORTED
    }
