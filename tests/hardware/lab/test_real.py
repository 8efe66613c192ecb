"""Backend real against the lab: camera and robot make the state."""

import copy
import dataclasses
import importlib.util
import threading
import time
from contextlib import closing

import numpy as np
import pytest
from typer.testing import CliRunner

import marl_airhockey as ah
from marl_airhockey.build import build_driven_world
from marl_airhockey.cli.main import app
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.registry import find_backend, make_driver
from marl_airhockey.sim.core.errors import UnknownKeywordError
from marl_airhockey.sim.core.table import TABLES


def keywords(rig, **options):
    return {
        "backend": "real",
        "rig": str(rig),
        "profile": "ur5e",
        "options": {"table": "full_size", **options},
    }


def test_a_policy_reaches_through_camera_and_robot(rig):
    driver = make_driver("zoo/reach_full_size")
    result = evaluate(driver, "reach", episodes=2, **keywords(rig))
    assert result.success == 1.0
    assert result.interrupted == 0


def test_frames_of_the_table_look_like_simulated_ones(rig):
    frames, images = "camera:colour=rgb,frames=2", []
    world = ah.make_world("juggle", observe=frames, **keywords(rig))
    try:
        seen = world.reset(0)
        for _ in range(6):
            seen = world.step(np.array([[[0.2, 0.1]]])).observation
        state = world.state
        images.append(seen["pixels"][0, 0])
        own = np.concatenate([state.paddle[0, 0], state.paddle_velocity[0, 0]])
        np.testing.assert_allclose(seen["agent_pos"][0, 0], own, rtol=1e-5)
    finally:
        world.close()
    form, options = f"{frames},rig={rig}", {"table": "full_size"}
    simulated = ah.make_world("juggle", observe=form, options=options)
    simulated.reset(0)
    state.velocity[:] = 0.0
    images.append(simulated.set_state(state)["pixels"][0, 0])
    table, model = (image.astype(int) for image in images)
    difference = np.abs(table - model)[..., 3:]
    assert difference.mean() < 6.0
    assert np.quantile(difference, 0.98) < 35.0


@pytest.mark.slow
def test_a_puck_is_seen_touched_and_lost_as_it_is(lab, rig):
    world = build_driven_world(
        make_driver("zoo/touch_full_size"), "touch", 1, keywords(rig)
    )
    try:
        world.reset(3)
        off = []
        for _ in range(60):
            result = world.step(np.zeros((1, 0, 2)))
            truth = lab.ask({"do": "truth"})
            off.append(np.linalg.norm(world.state.puck[0, 0] - truth["puck"]))
            if result.terminated[0] or result.truncated[0]:
                break
        assert np.median(off) < 0.01
        assert bool(world.memory["touches"].any()) == bool(truth["touches"])
        with pytest.raises(TypeError, match="real table"):
            copy.deepcopy(world)
    finally:
        world.close()


@pytest.mark.slow
def test_an_evaluation_names_the_reasons_of_interruptions(rig, fault):
    timer = threading.Timer(4.0, fault, ["frozen_camera"])
    timer.start()
    result = evaluate("zoo/juggle_full_size", "juggle", episodes=1, **keywords(rig))
    timer.join()
    assert result.interrupted == 1
    (reason, count), *_ = result.interruptions.items()
    assert count == 1
    assert "no frame" in reason
    assert result.to_json()["interruptions"] == {reason: 1}


@pytest.mark.parametrize(
    ("command", "missing"),
    [
        ("evaluate zoo/reach --backend real --lab --episodes 1", "rtde_control"),
        ("teleop reach --lab --no-browser", "rtde_control"),
        ("calibrate arm --lab", "rtde_control"),
        ("calibrate delay --lab", "rtde_control"),
        ("lab", "scipy"),
    ],
)
def test_a_command_names_a_missing_extra_before_the_lab_starts(
    monkeypatch, command, missing
):
    found = importlib.util.find_spec

    def find(name, *rest):
        return None if name == missing else found(name, *rest)

    def start(*_):
        raise AssertionError("a process was started")

    monkeypatch.setattr(importlib.util, "find_spec", find)
    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", start)
    monkeypatch.setattr(LabClient, "find", staticmethod(lambda: None))
    result = CliRunner().invoke(app, command.split())
    assert result.exit_code != 0
    said = result.output + str(result.exception)
    assert f"{missing} is not installed: pip install 'marl_airhockey[hardware]'" in said


def test_a_reach_beyond_the_joints_is_refused_before_anything_moves(rig, tmp_path):
    found = Rig.load(rig)
    fast = dataclasses.replace(found.limits, speed=1.0)
    path = tmp_path / "fast.json"
    dataclasses.replace(found, limits=fast).save(path)
    with pytest.raises(RuntimeError, match=r"joint \d needs .* for 1.0 m/s"):
        ah.parallel_env("reach", **keywords(path))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param("protective_stop", "protective stop", marks=pytest.mark.slow),
        ("frozen_camera", "no frame"),
        pytest.param("silent_robot", "robot silent", marks=pytest.mark.slow),
        pytest.param("lost_puck", "not seen", marks=pytest.mark.slow),
        ("stuck_frame", "the same frame for 0.3 s"),
        ("repeated_frames", "frames repeat the one before"),
        pytest.param("second_puck", "is there a second one", marks=pytest.mark.slow),
        pytest.param("delayed_frames", "frames arrive 0.", marks=pytest.mark.slow),
    ],
)
def test_what_fails_ends_the_episode_with_its_reason(lab, rig, fault, name, words):
    env = ah.parallel_env("juggle", **keywords(rig))
    try:
        env.reset(seed=0)
        fault(name)
        for _ in range(240 if name == "second_puck" else 80):
            _, _, terminated, truncated, infos = env.step({"paddle_0": np.zeros(2)})
            if truncated["paddle_0"]:
                break
            if terminated["paddle_0"]:
                # It is detected when the vision changes from one puck to the other.
                assert name == "second_puck"
                env.reset()
        assert truncated["paddle_0"]
        assert words in infos["paddle_0"]["interruption"]
    finally:
        env.close()


@pytest.mark.parametrize(
    ("task", "options", "words"),
    [
        ("duel", {}, "one arm"),
        ("move_block", {"shape": "square"}, "is a disc"),
        ("touch", {"obstacles": [[0.2, 0.0, 0.05]]}, "obstacles"),
        ("strike", {}, "tilted"),
        ("juggle", {"pucks": 2}, "one puck"),
    ],
)
def test_what_is_not_on_the_table_is_refused_in_words(task, options, words):
    scene = ah.make_scenario(task, table="full_size", **options).scene
    assert words in find_backend("real").supports(scene)


@pytest.mark.slow
def test_a_block_is_seen_where_it_is(tmp_path):
    with Lab(LabSetup(block=True)) as lab, served(lab, announce=False) as port:
        with closing(LabClient(port)) as client:
            calibrate_lab(client).save(tmp_path / "rig.json")
        settings = keywords(tmp_path / "rig.json")
        world = build_driven_world(make_driver("still"), "move_block", 1, settings)
        with closing(world):
            world.reset(3)
            for _ in range(20):
                world.step(np.zeros((1, 0, 2)))
                block = lab.ask({"do": "truth"})["block"]
                assert np.abs(world.state.block[0, 0] - block).max() < 0.003


def test_another_table_no_rig_and_a_wild_driver_are_refused(rig):
    with pytest.raises(ValueError, match="no block"):
        ah.parallel_env("move_block", **keywords(rig))
    with pytest.raises(ValueError, match="table=full_size"):
        ah.parallel_env("reach", **keywords(rig, table="standard"))
    with pytest.raises(ValueError, match="--lab"):
        ah.parallel_env("reach", backend="real")
    with pytest.raises(ValueError, match="no devices"):
        ah.parallel_env("reach", rig=str(rig))
    with pytest.raises(ValueError, match="real arm"):
        build_driven_world(make_driver("sticky"), "reach", 1, keywords(rig))
    with pytest.raises(UnknownKeywordError):
        ah.parallel_env("reach", rigg="x")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("moved_camera", "calibrate again"),
        ("dark_camera", "are the lights on"),
        ("second_puck", "2 objects have the puck's colour"),
    ],
)
def test_what_is_wrong_with_the_picture_is_noticed_first(rig, fault, name, words):
    fault(name)
    time.sleep(1.0)
    with pytest.raises(RuntimeError, match=words):
        ah.parallel_env("juggle", **keywords(rig))


def test_a_puck_without_the_mark_of_its_rig_is_noticed_first(rig, tmp_path):
    marked = tmp_path / "rig.json"
    dataclasses.replace(Rig.load(rig), puck_marked=True).save(marked)
    with pytest.raises(RuntimeError, match="shows no mark"):
        ah.parallel_env("juggle", **keywords(marked))


def test_what_the_rig_says_need_not_be_said(rig):
    env = ah.parallel_env("reach", backend="real", rig=str(rig))
    try:
        assert env.unwrapped.world.scene.table == TABLES["full_size"]
        assert "own.requested[-1].x" in env.unwrapped.world.observer.labels
    finally:
        env.close()
