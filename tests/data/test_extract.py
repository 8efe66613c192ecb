"""A video in which nothing is to be found is refused."""

from dataclasses import replace

import numpy as np
import pytest

from marl_airhockey.data.extract import extract
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import lab_view
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.vision import Colour
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.render.mp4 import Mp4Writer

VIEW = lab_view(TABLES["full_size"])
RIG = Rig(
    "full_size",
    "v4l2:0",
    VIEW,
    Colour(2.0),
    "192.168.1.2",
    LabSetup().mounting,
    paddle=Colour(60.0),
)


def test_a_video_without_puck_and_paddle_is_refused(tmp_path):
    width, height = VIEW.lens.size
    writer = Mp4Writer(tmp_path / "grey.mp4", 30)
    for _ in range(5):
        writer.append(np.full((height, width, 3), 120, np.uint8))
    writer.close()
    with pytest.raises(ValueError, match=r"grey.mp4: no frame shows a puck"):
        extract(tmp_path / "grey.mp4", RIG)
    with pytest.raises(ValueError, match="calibrate again"):
        extract(tmp_path / "grey.mp4", replace(RIG, paddle=None))
