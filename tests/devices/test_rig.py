"""Rigs: one file for all that is calibrated at a table."""

import json
from dataclasses import replace

import pytest

from marl_airhockey.core.table import TABLES
from marl_airhockey.devices.rig import Pendant, Rig
from marl_airhockey.devices.robot.shaper import MotionLimits
from marl_airhockey.devices.vision import Colour
from marl_airhockey.devices.vision.calibration import tag_corners
from marl_airhockey.lab.setup import LabSetup
from marl_airhockey.lab.table_camera import lab_view, tag_places
from marl_airhockey.world.build import table_keywords

TABLE = TABLES["full_size"]
TAGS = {str(k): tag_corners(p).tolist() for k, p in tag_places(TABLE).items()}
RIG = Rig(
    "full_size",
    "v4l2:0",
    lab_view(TABLE),
    Colour(2.0),
    "192.168.1.2",
    LabSetup().mounting,
    tags=TAGS,
)


def test_it_is_the_same_after_a_file(tmp_path):
    RIG.save(tmp_path / "rig.json")
    assert Rig.load(tmp_path / "rig.json") == RIG


@pytest.mark.parametrize(
    ("given", "profile"), [(None, "ur5e"), ("ideal", "ur5e"), ("gantry", "gantry")]
)
def test_keywords_get_table_and_profile_of_the_rig(tmp_path, given, profile):
    RIG.save(tmp_path / "rig.json")
    keywords = {"backend": "real", "rig": str(tmp_path / "rig.json")}
    keywords |= {} if given is None else {"profile": given}
    found = table_keywords(keywords)
    assert found["profile"] == profile
    assert found["options"] == {"table": "full_size"}
    assert table_keywords({"profile": "ideal"}) == {"profile": "ideal"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.update(format=9), "format 9"),
        (lambda d: d.pop("view"), "view"),
        (lambda d: d["puck"].pop("hue"), "hue"),
        (lambda d: d["limits"].update(speed=0), "speed"),
    ],
)
def test_a_broken_file_is_named(tmp_path, change, words):
    path = tmp_path / "rig.json"
    RIG.save(path)
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match=words):
        Rig.load(path)


def test_a_file_that_is_missing_or_no_json_is_named(tmp_path):
    with pytest.raises(ValueError, match="airhockey calibrate"):
        Rig.load(tmp_path / "rig.json")
    (tmp_path / "rig.json").write_text("{")
    with pytest.raises(ValueError, match=r"rig\.json"):
        Rig.load(tmp_path / "rig.json")


def test_limits_leave_room_below_the_pendants():
    with pytest.raises(ValueError, match="pendant"):
        replace(RIG, limits=MotionLimits(speed=1.2))
    replace(RIG, limits=MotionLimits(speed=1.2), pendant=Pendant(speed=2.0))
