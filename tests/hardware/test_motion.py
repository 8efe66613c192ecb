"""Sent positions are ahead of the arm by no more than it closes at its limit."""

import numpy as np
import pytest

from marl_airhockey.hardware.robot import MotionLimits, RobotConfig
from marl_airhockey.hardware.robot.motion import Motion
from marl_airhockey.hardware.robot.nominal import nominal_mounting
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

TABLE = TABLES["full_size"]
REACH = make_seat("robot", TABLE, 0).reach
DT = 0.008


@pytest.mark.parametrize("speed", [0.1, 0.7])
@pytest.mark.parametrize("fresh", [False, True])
def test_a_target_stops_ahead_of_an_arm_that_stands_still(speed, fresh):
    """With news of it, and without: a controller that stalls sends none."""
    limits = MotionLimits(speed=speed)
    config = RobotConfig("", nominal_mounting(TABLE), REACH, limits)
    start = np.array([*np.mean(REACH, 0), 0.0])
    motion, gaps = Motion(config, DT, start), []
    for k in range(100):
        motion.measure(k * fresh, start)
        motion.step(np.array([0.0, 9.0]), 0.0)
        gaps.append(np.linalg.norm(motion.shaper.place - start[:2]))
    assert max(gaps) < motion.most + speed * DT
    assert np.ptp(gaps[-20:]) < speed * DT
