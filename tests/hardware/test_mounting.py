"""Where a table lies in a robot's frame, from places that the tool has touched."""

import numpy as np
import pytest

from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.robot.mounting import Mounting, fit_mounting

TRUE = LabSetup().mounting
PLACES = np.array([(x, y) for x in (-0.8, -0.6, -0.5) for y in (-0.2, 0.0, 0.2)])


def test_there_and_back_again():
    pose = TRUE.pose(np.array([-0.6, 0.1]), 0.02)
    np.testing.assert_allclose(TRUE.to_table(pose), [-0.6, 0.1, 0.02], atol=1e-12)


def test_nine_touches_find_the_table():
    rng = np.random.default_rng(0)
    touched = np.array([TRUE.pose(p)[:3] for p in PLACES])
    touched += rng.normal(0.0, 0.0003, touched.shape)
    found = fit_mounting(PLACES, touched, np.array(TRUE.tool))
    assert isinstance(found, Mounting)
    assert 0.0001 < found.residual < 0.001
    far = found.pose(np.array([-0.5, 0.3]))[:3] - TRUE.pose(np.array([-0.5, 0.3]))[:3]
    assert np.linalg.norm(far) < 0.001


def test_a_line_and_too_few_points_are_refused():
    line = np.array([(x, 0.0) for x in (-0.8, -0.7, -0.6)])
    touched = np.array([TRUE.pose(p)[:3] for p in line])
    with pytest.raises(ValueError, match="line"):
        fit_mounting(line, touched, np.zeros(3))
    with pytest.raises(ValueError, match="at least 3"):
        fit_mounting(line[:2], touched[:2], np.zeros(3))


def test_a_mirrored_picture_is_refused():
    touched = np.array([TRUE.pose(p)[:3] for p in PLACES])
    with pytest.raises(ValueError, match="mirrored"):
        fit_mounting(PLACES * (1.0, -1.0), touched, np.array(TRUE.tool))
