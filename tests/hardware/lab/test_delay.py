"""Delays that are measured by the arm's own motion."""

import numpy as np
import pytest

from marl_airhockey.hardware.calibration.delay import (
    find_delay,
    frame_times,
    measure_delays,
)
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.camera import CameraFrame
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.rig import Rig


def test_a_shift_is_found_whatever_the_distance():
    times = np.arange(0.0, 3.0, 0.008)
    early = np.stack([times, 0.1 * np.sin(6 * times), 0.05 * np.cos(5 * times)], 1)
    rng = np.random.default_rng(0)
    for delay in (0.003, 0.0415, 0.2):
        when = np.sort(rng.uniform(1.0, 2.0, 30))
        then = when - delay
        place = np.stack([0.1 * np.sin(6 * then), 0.05 * np.cos(5 * then)], 1)
        late = np.column_stack([when, place + np.array([0.02, -0.01])])
        late[:, 1:] += rng.normal(0.0, 0.0003, place.shape)
        assert find_delay(late, early) == pytest.approx(delay, abs=0.0015)


@pytest.mark.slow
def test_the_lab_s_camera_is_as_late_as_it_was_set_up():
    pytest.importorskip("rtde_control")
    latency = 0.045
    with Lab(LabSetup(latency=latency)) as lab, served(lab, announce=False) as port:
        client = LabClient(port)
        rig = calibrate_lab(client)
        client.close()
        found = measure_delays(rig, 8)
    assert found.camera.mean() == pytest.approx(latency, abs=0.003)
    assert 0.03 < found.arm.mean() < 0.12
    assert found.period == pytest.approx(1 / 30, rel=0.05)
    assert found.dropped < 0.05


def test_missing_numbers_are_dropped_frames():
    kept = [k for k in range(200) if k % 10 != 3]
    frames = [CameraFrame(np.zeros(0), 5.0 + k / 60, k) for k in kept]
    period, dropped = frame_times(frames)
    assert period == pytest.approx(1 / 60)
    assert dropped == pytest.approx(0.1)


def test_a_rig_without_the_paddle_s_colour_is_refused(rig):
    known = Rig.load(rig)
    with pytest.raises(ValueError, match="no colour of the paddle"):
        measure_delays(Rig(**{**vars(known), "paddle": None}), 5)
