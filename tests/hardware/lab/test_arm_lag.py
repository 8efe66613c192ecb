"""Dead time and lag of an arm, by steps and chirps."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from marl_airhockey.cli.main import app
from marl_airhockey.hardware.calibration.arm import along, chirp, find_lag, steps
from marl_airhockey.hardware.calibration.motion import RecordedMotion, lead
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import Robot
from marl_airhockey.hardware.robot.config import ServoSettings
from marl_airhockey.hardware.ur_emulator.script import DEAD_TIME
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.servo import HALF
from marl_airhockey.sim.core.table import TABLES

HALF_RISE = ServoSettings().look_ahead + DEAD_TIME
"""Time in which the lab's arm makes half of a step, s"""


def answer(path, dead, half, seconds):
    """Return a motion of an arm of known lag, sent and reported at 125 Hz."""
    dt, w = 0.0005, HALF / half
    times = np.arange(-0.5, seconds, dt)
    aim = np.array([path(max(t, 0.0))[0] for t in times])
    place, speed, answered = aim[0], 0.0, []
    for target in aim:
        answered.append(place)
        speed += (w * w * (target - place) - 2 * w * speed) * dt
        place += speed * dt
    rows = np.arange(0.0, seconds, 0.008)
    sent = np.stack([rows, np.interp(rows, times, aim), 0 * rows], 1)
    reported = np.interp(rows - dead, times, answered)
    return RecordedMotion(np.stack([rows, reported, 0 * rows], 1), sent)


@pytest.mark.parametrize(("path", "name"), [(steps, "steps"), (chirp, "chirp")])
@pytest.mark.parametrize(
    ("dead", "half"), [(0.006, 0.054), (0.02, 0.09), (0.003, 0.03)]
)
def test_a_known_lag_is_found(path, name, dead, half):
    found = find_lag(answer(path, dead, half, 6.0), 0, name)
    assert found.action_delay == pytest.approx(dead, abs=0.001)
    assert found.servo_time == pytest.approx(half, abs=0.001)
    assert found.misfit < 3e-4


def test_gain_and_phase_are_those_of_the_lag():
    found = find_lag(answer(chirp, 0.01, 0.06, 12.0), 0, "chirp")
    for frequency, (gain, phase) in found.response.items():
        turn = 2 * np.pi * frequency * 0.06 / HALF
        assert gain == pytest.approx(1 / (1 + turn**2), abs=0.02)
        wanted = -2 * np.degrees(np.arctan(turn)) - 360 * frequency * 0.01
        assert phase == pytest.approx(wanted, abs=3.0)


@pytest.mark.slow
def test_the_lab_s_arm_is_as_slow_as_its_controller_says(rig):
    known = Rig.load(rig)
    reach = make_seat("robot", TABLES[known.table], 0).reach
    home = np.mean(reach, 0)
    with Robot(known.robot_config(reach)) as robot:
        robot.go_to(home)
        motion = lead(robot, home, along(steps, 1), 4.0)
    found = find_lag(motion, 1, "steps")
    assert found.servo_time == pytest.approx(HALF_RISE, abs=0.006)
    assert found.action_delay < 0.02
    assert found.lag == pytest.approx(ServoSettings().lag, abs=0.006)
    assert found.misfit < 0.002


@pytest.mark.slow
def test_the_command_measures_both_axes():
    pytest.importorskip("rtde_control")
    words = ["calibrate", "arm", "--lab", "--repeats", "1", "--json"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["servo_time"]["mean"] == pytest.approx(HALF_RISE, abs=0.006)
    assert {(t["motion"], t["axis"]) for t in found["trials"]} == {
        (motion, axis) for motion in ("steps", "chirp") for axis in "xy"
    }
