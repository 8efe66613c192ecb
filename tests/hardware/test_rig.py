"""Rigs: one file for all that is calibrated at a table."""

import json
from dataclasses import MISSING, fields, replace

import numpy as np
import pytest

from marl_airhockey.build import table_keywords
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import lab_view, tag_places
from marl_airhockey.hardware.rig import Pendant, Rig
from marl_airhockey.hardware.robot.config import ServoSettings
from marl_airhockey.hardware.robot.shaper import MotionLimits
from marl_airhockey.hardware.vision import Colour
from marl_airhockey.hardware.vision.calibration import tag_corners
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

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


def saved(tmp_path, path, value):
    """Return the file of a rig in which one field, by its path, has another value."""
    file = tmp_path / "rig.json"
    RIG.save(file)
    data = json.loads(file.read_text())
    *above, last = path.split(".")
    part = data
    for name in above:
        part = part[name]
    if value is MISSING:
        del part[last]
    else:
        part[last] = value
    file.write_text(json.dumps(data))
    return file


def numbers_in(value, path=()):
    """Yield the path of each number in a JSON object."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from numbers_in(part, (*path, name))
    elif isinstance(value, list):
        for k, part in enumerate(value):
            yield from numbers_in(part, (*path, k))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


MIRRORED = (np.diag([1.0, -1.0, 1.0]) @ np.array(RIG.mounting.rotation)).tolist()
UPSIDE_DOWN = (np.array(RIG.mounting.rotation) @ np.diag([1.0, -1.0, -1.0])).tolist()
BROKEN = [
    ("format", 9, "format 9"),
    ("view", MISSING, "view: it is missing"),
    ("puck.hue", MISSING, "puck.hue: it is missing"),
    ("puck.hue", 500, "puck.hue: 500; expected .* 0 to 180"),
    ("puck.brightness", 60.5, "puck.brightness: 60.5; expected a finite whole number"),
    ("limits.speed", 0, "limits.speed: 0; expected"),
    ("limits.speed", True, "limits.speed: True"),
    ("limits.sped", 0.1, "limits: unknown field 'sped'; there are: speed"),
    ("payloads", 0.1, "unknown field 'payloads' .did you mean 'payload'"),
    ("payload", "0.6", "payload: '0.6'; expected a finite number from 0 to 5"),
    ("payload", 60.0, "payload: 60.0"),
    ("pendant.speed", float("nan"), "pendant.speed: nan"),
    ("latency", float("nan"), "latency: nan"),
    ("latency", -0.1, "latency: -0.1; expected a finite number from 0 to 1"),
    ("table", "half_size", "table: unknown table 'half_size'; there are: full_size"),
    ("operator", "somebody", "operator: 'somebody'; expected person or lab:PORT"),
    ("robot", 12, "robot: 12; expected a str"),
    ("tool", [0.0, 0.0, 0.12], "tool: .*expected x, y, z"),
    ("tool", [0.0, 0.0, 120.0, 0.0, 0.0, 0.0], "tool: .*at most 1 m"),
    ("mounting.rotation", MIRRORED, "mounting.rotation: .*right-handed"),
    ("mounting.rotation", UPSIDE_DOWN, "normal is 17.* deg away from the base's z"),
    (
        "mounting.rotation",
        [[1.0, 0.0], [0.0, 1.0]],
        r"rotation.0.: .*3 values",
    ),
    ("mounting.tool", [0.0, 0.0, 0.0], "mounting.tool: its z is 17.* deg away"),
    ("mounting.tool", [1.57, 0.0, 0.0], "mounting.tool: its z is 9.* deg away"),
    ("mounting.origin", [590.0, 0.0, 55.0], "mounting.origin.*from -3 to 3"),
    ("view.lens.matrix", [[-600, 0, 320], [0, 600, 240], [0, 0, 1]], "fx and fy above"),
    ("view.translation", [0.0, 0.0, -2.0], "view.translation: the camera is .* below"),
    ("view.lens.size", [640], "view.lens.size: .*expected 2 values"),
    ("tags", {"seven": [[0, 0]] * 4}, "tags: 'seven'"),
    ("tags", {"7": [[0, 0]] * 3}, "tags: '7'"),
    ("smoothing", {"name": "median"}, "smoothing.name: unknown filter 'median'"),
    ("servo.lag", 0.0, "servo.lag"),
    ("puck", [1, 2], "puck: .*expected an object"),
]


@pytest.mark.parametrize(("path", "value", "words"), BROKEN)
def test_a_broken_field_is_named(tmp_path, path, value, words):
    with pytest.raises(ValueError, match=words):
        Rig.load(saved(tmp_path, path, value))


def test_the_lag_of_a_rig_is_that_of_its_robot(tmp_path):
    known = Rig.load(saved(tmp_path, "servo.lag", 0.09))
    config = known.robot_config(make_seat("robot", TABLE, 0).reach)
    assert config.servo == ServoSettings(lag=0.09)


def test_no_number_of_a_rig_may_be_nan_or_infinite(tmp_path):
    file = tmp_path / "rig.json"
    RIG.save(file)
    whole = file.read_text()
    paths = [*numbers_in(json.loads(whole))]
    assert len(paths) > 60
    for path in paths:
        for value in (float("nan"), float("inf"), "1", None):
            data = json.loads(whole)
            part = data
            for name in path[:-1]:
                part = part[name]
            part[path[-1]] = value
            file.write_text(json.dumps(data))
            with pytest.raises(ValueError, match=str(path[0])):
                Rig.load(file)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"reach": ((0, 0), (0, 1), (1, 1), (1, 0))}, "reach: .*counter-clockwise"),
        ({"reach": ((0, 0), (1, 0))}, "reach: 2 corners"),
        ({"reach": ((0, 0), (1, 0), (np.nan, 1))}, "reach"),
        ({"mounting": None}, "mounting: None; expected a Mounting"),
        ({"servo": replace(ServoSettings(), gain=100.0), "payload": -1.0}, "payload"),
    ],
)
def test_a_driver_s_configuration_is_checked_too(changes, words):
    config = RIG.robot_config(make_seat("robot", TABLE, 0).reach)
    with pytest.raises(ValueError, match=words):
        replace(config, **changes)


@pytest.mark.parametrize("name", [f.name for f in fields(ServoSettings)])
def test_settings_of_the_servo_loop_have_ranges(name):
    for value in (-1.0, 1e6, np.nan):
        with pytest.raises(ValueError, match=name):
            replace(ServoSettings(), **{name: value})


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
