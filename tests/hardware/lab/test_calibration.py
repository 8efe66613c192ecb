"""A calibration, step by step, in the virtual lab: what it finds is what is there."""

import re

import numpy as np
import pytest

from marl_airhockey.hardware.calibration.hand_session import CORNERS, HandSession
from marl_airhockey.hardware.calibration.helper import HandHelper, Helper
from marl_airhockey.hardware.calibration.session import TOUCHES, CalibrationSession
from marl_airhockey.hardware.calibration.sheets import PAGE, write_sheets
from marl_airhockey.hardware.camera import Camera, open_source
from marl_airhockey.hardware.hand_rig import HandRig
from marl_airhockey.hardware.lab.hand_camera import hand_view
from marl_airhockey.hardware.lab.lab import LabClient, served
from marl_airhockey.hardware.lab.table_camera import lab_view, tag_places
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot.ur5e import PoseReader
from marl_airhockey.hardware.vision.boards import find_board
from marl_airhockey.hardware.vision.calibration import find_tags, tag_corners

BESIDE = np.array([0.029, 0.0, 0.06])
"""Way from the middle of a paddle's foot to where it is seen beside the arm, m"""


@pytest.fixture
def session(lab, tmp_path):
    with served(lab, announce=False) as port:
        client = LabClient(port)
        rig = {"table": "full_size", "camera": f"stream:{lab.camera_port}"}
        rig |= {"robot": lab.host, "operator": f"lab:{port}"}
        with Camera(open_source(rig["camera"])) as camera:
            pose = PoseReader(lab.host).pose
            made = CalibrationSession(camera, pose, rig, tmp_path / "rig.json")
            made.devices = camera, pose, rig
            made.orders.update(Helper(client).orders)
            yield made
        client.close()


@pytest.mark.slow
def test_a_calibration_from_nothing_finds_what_is_there(lab, session, tmp_path):
    view, corners = lab_view(lab.setup.geometry), np.array(lab.setup.geometry.vertices)
    with pytest.raises(ValueError, match="lens is missing"):
        session.do("table")
    for _ in range(9):
        session.do("show_board")
        session.do("board")
    session.do("lens")
    session.do("guide")
    rng = np.random.default_rng(0)
    for x, y in view.project(np.column_stack([corners, np.zeros(4)])):
        session.do("corner", x + rng.normal(), y + rng.normal())
    session.do("table")
    puck, paddle = np.array([0.3, 0.0, 0.003]), np.zeros(3)
    paddle[:2] = np.mean(lab.setup.seat.reach, 0)
    session.do("puck", *view.project(puck[None])[0])
    session.do("paddle", *view.project((paddle + BESIDE)[None])[0])
    with pytest.raises(ValueError, match=f"{TOUCHES} or more"):
        session.do("robot")
    for _ in range(TOUCHES):
        session.do("touch")
        session.do("guide")
    session.do("robot")
    session.do("save")
    rig = Rig.load(tmp_path / "rig.json")
    grid = np.array([(x, y, 0.0) for x in (-0.8, 0.0, 0.8) for y in (-0.3, 0.3)])
    off = rig.view.to_table(view.project(grid)) - grid[:, :2]
    assert np.linalg.norm(off, axis=1).max() < 0.003
    # The same with tags that a person has measured to 1 mm, instead of clicks.
    tags = {
        k: tag_corners(place + rng.normal(0.0, 0.001, 2))
        for k, place in tag_places(lab.setup.geometry).items()
    }
    again = CalibrationSession(*session.devices, tmp_path / "tags.json", tags)
    again.found.lens = session.found.lens
    again.do("table")
    off = again.found.view.to_table(view.project(grid)) - grid[:, :2]
    assert np.linalg.norm(off, axis=1).mean() < 0.001
    true = lab.setup.mounting
    places = np.array(lab.setup.seat.reach)
    apart = [true.pose(p)[:3] - rig.mounting.pose(p)[:3] for p in places]
    assert np.linalg.norm(apart, axis=1).max() < 0.005
    assert rig.mounting.tilt == pytest.approx(lab.setup.tilt, abs=0.3)


def test_what_is_asked_for_in_vain_is_named(session):
    with pytest.raises(ValueError, match="expected one of board"):
        session.do("dance")
    with pytest.raises(ValueError, match="board is not seen"):
        session.do("board")
    with pytest.raises(ValueError, match="no colour"):
        session.do("puck", 10.0, 10.0)
    with pytest.raises(ValueError, match="is missing"):
        session.do("save")


def test_printed_sheets_hold_what_is_looked_for(tmp_path):
    for sheet in write_sheets(tmp_path):
        text = sheet.read_bytes()
        assert text.startswith(b"%PDF")
        width = float(re.search(rb"/MediaBox\s*\[\s*0 0 ([\d.]+)", text)[1])
        # A point is 1/72 in: what is printed at 100 % is as wide as it says.
        assert width / 72 * 0.0254 == pytest.approx(PAGE[0], abs=2e-4)


def test_a_picture_without_a_board_or_tags_has_none():
    empty = np.full((480, 640, 3), 90, np.uint8)
    assert find_board(empty) is None
    assert find_tags(empty) == {}


@pytest.mark.slow
def test_a_hand_is_calibrated_from_nothing(lab, tmp_path):
    true = hand_view()
    with served(lab, announce=False) as port:
        client = LabClient(port)
        helper = HandHelper(client)
        with Camera(open_source(helper.source)) as camera:
            path = tmp_path / "hand.json"
            session = HandSession(camera, helper.source, (0.5, 0.6), path)
            session.orders.update(helper.orders)
            for _ in range(9):
                session.do("show_board")
                session.do("board")
            session.do("lens")
            session.do("board_away")
            corners = np.column_stack([CORNERS * (0.25, 0.3), np.zeros(4)])
            rng = np.random.default_rng(0)
            for x, y in true.project(corners):
                session.do("corner", x + rng.normal(), y + rng.normal())
            session.do("table")
            with pytest.raises(ValueError, match="paddle's colour is missing"):
                session.do("save")
            session.do("paddle", *true.project(np.array([[0.03, 0.0, 0.06]]))[0])
            session.do("save")
            assert session.picture()
            assert session.state()["kind"] == "hand"
        client.close()
    rig = HandRig.load(path)
    places = np.array([[x, y, 0.06] for x in (-0.2, 0.2) for y in (-0.25, 0.25)])
    off = rig.view.to_table(true.project(places), 0.06) - places[:, :2]
    assert np.abs(off).max() < 0.004
    assert len(rig.tags) >= 4
