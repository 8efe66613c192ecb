"""Report of the faults that are switched on."""

from contextlib import closing

import pytest

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.lab.lab import LabClient, served
from marl_airhockey.hardware.ur_emulator.controller import UNLOCK_AFTER
from marl_airhockey.hardware.ur_emulator.faults import FAULTS, faults_of


@pytest.fixture(scope="module")
def robot():
    return EmulatedRobot()


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_reported_until_it_is_switched_off(robot, name):
    assert faults_of(robot.controller) == []
    robot.switch(name)
    lasting = [] if name == "carried_arm" else [name]
    assert faults_of(robot.controller) == lasting
    robot.switch(name, on=False)
    assert faults_of(robot.controller) == []


def test_unlocked_protective_stop_is_not_reported(robot):
    robot.switch("protective_stop")
    robot.advance(UNLOCK_AFTER + 0.1)
    assert robot.controller.unlock()
    assert faults_of(robot.controller) == []


def test_lab_reports_its_faults(lab, fault):
    with served(lab, announce=False) as port, closing(LabClient(port)) as client:
        assert client.ask("faults") == {"on": []}
        fault("local_control")
        fault("lost_puck")
        fault("dark_camera")
        names = ["local_control", "dark_camera", "lost_puck"]
        assert client.ask("faults") == {"on": names}
        client.ask("place", puck=[0.3, 0.0], velocity=[0.0, 0.0])
        client.ask("fault", name="local_control", on=False)
        assert client.ask("faults") == {"on": ["dark_camera"]}
