"""The robot in the virtual lab, by LeRobot's own commands."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from lerobot.datasets import LeRobotDataset
from lerobot.robots import make_robot_from_config
from lerobot.teleoperators import make_teleoperator_from_config
from lerobot_robot_airhockey import AirHockeyDriverConfig, AirHockeyPaddleConfig
from lerobot_robot_airhockey.paddle import FEATURES

from marl_airhockey.hardware.calibration.lab_rig import running_lab

BIN = Path(sys.executable).parent


@pytest.fixture(scope="module", autouse=True)
def lab():
    with running_lab() as client:
        yield client


RECORD = """
lerobot-record --robot.type=airhockey_paddle --robot.id=lab
    --teleop.type=airhockey_driver --teleop.driver=striker --dataset.repo_id=me/lab
    --dataset.root=set --dataset.fps=20 --dataset.num_episodes=2
    --dataset.episode_time_s=6 --dataset.reset_time_s=1 --dataset.push_to_hub=false
    --dataset.single_task=strike --dataset.rgb_encoder.vcodec=h264 --play_sounds=false
"""
REPLAY = """
lerobot-replay --robot.type=airhockey_paddle --robot.id=lab --dataset.repo_id=me/lab
    --dataset.root=set --dataset.episode=0 --play_sounds=false
"""


def call(folder, line):
    command, *words = line.split()
    done = subprocess.run(
        [str(BIN / command), *words], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Folder with a dataset of two episodes, which lerobot-record has recorded."""
    folder = tmp_path_factory.mktemp("lerobot")
    call(folder, RECORD)
    return folder


def test_two_episodes_are_recorded(recorded):
    data = LeRobotDataset("me/lab", root=recorded / "set")
    assert data.num_episodes == 2
    names = data.features["observation.state"]["names"]
    assert names == [*FEATURES]
    rows = np.stack([data[k]["observation.state"].numpy() for k in range(len(data))])
    state = dict(zip(names, rows.T, strict=True))
    action = np.stack([data[k]["action"].numpy() for k in range(len(data))])
    assert np.abs(action).max() > 0.3
    assert np.ptp(state["own.x"]) > 0.02
    assert np.ptp(state["puck.x"]) > 0.2
    # What was sent follows what was chosen, within the limits of the arm.
    assert np.corrcoef(action[:-2, 0], state["sent.x"][2:])[0, 1] > 0.5
    assert (state["frame.age"] > state["frame.delay"]).all()
    assert 0.01 < np.median(state["frame.delay"]) < 0.15
    assert np.median(state["command.age"]) < 0.1
    assert abs(np.median(state["period"][1:]) - 0.05) < 0.01
    image = data[5]["observation.images.table"]
    assert image.shape == (3, 240, 320)
    assert float(image.std()) > 0.05


def test_an_episode_is_replayed(recorded):
    call(recorded, REPLAY)


def test_a_stop_of_the_arm_ends_the_session(lab):
    robot = make_robot_from_config(AirHockeyPaddleConfig(id="lab"))
    robot.connect()

    def play():
        for _ in range(60):
            robot.get_observation()
            robot.send_action({"x": 0.0, "y": 0.3})
            time.sleep(0.05)

    try:
        robot.get_observation()
        lab.ask("fault", name="protective_stop", on=True)
        with pytest.raises(RuntimeError, match="protective stop"):
            play()
    finally:
        robot.disconnect()
        lab.ask("fault", name="protective_stop", on=False)
    assert not robot.is_connected


@pytest.mark.parametrize(
    ("driver", "reason"),
    [("zoo/juggle", "observations of a task"), ("random", "cannot move a real arm")],
)
def test_drivers_that_cannot_move_the_arm_are_refused_at_once(driver, reason):
    teleop = make_teleoperator_from_config(AirHockeyDriverConfig(driver=driver))
    with pytest.raises(ValueError, match=reason):
        teleop.connect()


def test_wrong_actions_are_named():
    robot = make_robot_from_config(AirHockeyPaddleConfig(id="lab"))
    with pytest.raises(ValueError, match="expected x and y"):
        robot.send_action({"vx": 0.0})
    with pytest.raises(RuntimeError, match="connect"):
        robot.get_observation()
