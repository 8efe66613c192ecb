"""Frames of a camera as observations: the model, its times, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import (
    Seen,
    TableCamera,
    lab_view,
    tag_places,
)
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.table.overlay import cropped
from marl_airhockey.hardware.vision import Colour
from marl_airhockey.hardware.vision.calibration import tag_corners
from marl_airhockey.sim.contracts.camera_model import PUCK, lab_camera, project
from marl_airhockey.sim.core.table import TABLES

TABLE = TABLES["full_size"]
FORM = "camera:colour=rgb,frames=1"
FULL = {"options": {"table": "full_size"}}


def rig_of(folder, **changes):
    """Return the file of the rig of the virtual lab."""
    tags = {str(k): tag_corners(p).tolist() for k, p in tag_places(TABLE).items()}
    given = Colour(0.4, saturation=123, brightness=123)
    parts = lab_view(TABLE), given, "192.168.1.2", LabSetup().mounting
    rig = Rig("full_size", "v4l2:0", *parts, tags=tags)
    replace(rig, **changes).save(folder / "rig.json")
    return folder / "rig.json"


def world_at(observe, puck, paddle=(-0.65, 0.05)):
    """Return the frame of a world whose bodies rest at given positions, and it."""
    world = ah.make_world("strike", observe=observe, **FULL)
    world.reset(0)
    state = world.state
    state.position[0, :2] = [paddle, puck]
    state.velocity[:] = 0.0
    return world.set_state(state)["pixels"][0, 0].astype(float), world


def test_points_are_projected_as_by_opencv():
    model, view = lab_camera(TABLE), lab_view(TABLE)
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3)) * [1, 0.5, 0.2]
    pixels = np.stack(project(model.numbers, *points.T), -1)
    np.testing.assert_allclose(pixels, view.project(points), atol=1e-9)
    back = model.places(view.project(points * [1, 1, 0]))
    np.testing.assert_allclose(back, points[:, :2], atol=1e-6)


@pytest.mark.parametrize("colour", ["grey", "rgb"])
def test_a_simulated_frame_agrees_with_the_camera_of_the_lab(tmp_path, colour):
    path = rig_of(tmp_path)
    model, still = Rig.load(path).camera_model, np.zeros(2)
    camera = TableCamera(TABLE, lab_view(TABLE), np.array(model.base))
    rng = np.random.default_rng(1)
    for _ in range(3):
        puck = rng.uniform([-0.2, -0.35], [0.85, 0.35])
        paddle = rng.uniform([-0.75, -0.3], [-0.5, 0.3])
        shots = [
            camera.photograph(Seen(puck, still, paddle, still), k) for k in range(6)
        ]
        mean = np.mean(shots, 0).round().astype(np.uint8)
        lab = cropped(mean, model.window(TABLE), 84)[..., ::-1]
        if colour == "grey":
            lab = (lab * [0.299, 0.587, 0.114]).sum(-1, keepdims=True)
        form = f"camera:rig={path},colour={colour},frames=1"
        image, _ = world_at(form, puck, paddle)
        difference = np.abs(image - lab)
        # Most of it is the light, which is weaker at one side of the lab.
        assert difference.mean() < 5.0
        assert np.quantile(difference, 0.98) < 30.0


def test_the_puck_has_the_colour_of_the_rig_and_is_blurred_when_it_moves(tmp_path):
    path = rig_of(tmp_path, exposure=0.02)
    image, world = world_at(f"camera:rig={path},colour=rgb,frames=1,size=200", (0.2, 0))
    assert np.abs(image - PUCK).sum(-1).min() < 8
    state = world.state
    state.velocity[0, 1] = [0.0, 2.0]
    fast = world.set_state(state)["pixels"][0, 0].astype(float)
    red = [(x[..., 0] - x[..., 1]).clip(0.0).sum(1) for x in (image, fast)]
    row = np.arange(200)
    means = [(x * row).sum() / x.sum() for x in red]
    spread = [
        (x * (row - m) ** 2).sum() / x.sum() for x, m in zip(red, means, strict=True)
    ]
    # Variances of a disc, and of a motion of 0.02 s at 2 m/s.
    expected = 1.0 + (0.04**2 / 12) / (TABLE.puck_radius**2 / 4)
    assert spread[1] / spread[0] == pytest.approx(expected, rel=0.05)
    assert red[1].sum() == pytest.approx(red[0].sum(), rel=0.04)


def ages_of(form, worlds):
    """Return the ages (worlds,) of the newest frames, s."""
    world = ah.make_world("strike", worlds, observe=form, **FULL)
    world.reset(0)
    state = world.state
    state.position[:, 1], state.velocity[:, 1] = (0.0, 0.0), (0.5, 0.0)
    world.set_state(state)
    return -world.sensor.photos[form].rows[:, -1, 1, 0] / 0.5


def test_frames_have_the_latency_of_the_camera_and_the_time_between_frames():
    ages = ages_of(FORM, 64)
    assert ages.min() > 0.028 - 1e-9
    assert ages.max() < 0.028 + 1 / 30
    assert ages.mean() == pytest.approx(0.028 + 1 / 60, abs=0.004)


def test_dropped_frames_make_the_newest_one_older(tmp_path):
    path = rig_of(tmp_path, dropped=0.3, latency=0.01)
    ages = ages_of(f"camera:rig={path},frames=1", 512)
    missing = np.floor((ages - 0.01) * 60 + 1e-6)
    shares = [(missing == k).mean() for k in range(3)]
    np.testing.assert_allclose(shares, [0.7, 0.21, 0.09], atol=0.06)


def test_the_own_paddle_is_reported_without_the_latency_of_frames():
    world = ah.make_world("reach", 2, observe=FORM)
    world.reset(0)
    for _ in range(4):
        seen = world.step(np.full((2, 1, 2), 0.5)).observation
    state = world.state
    expected = np.concatenate([state.paddle, state.paddle_velocity], -1)
    np.testing.assert_allclose(seen["agent_pos"], expected, rtol=1e-6)
    frames = world.sensor.photos[FORM].rows[:, -1, 0, :2]
    assert (frames != state.paddle[:, 0]).any(-1).all()
    single = world.observation_space
    assert single.contains({name: part[0, 0] for name, part in seen.items()})


def test_goals_are_outlines_over_the_frame():
    world = ah.make_world("reach", observe="camera:colour=rgb,size=128,frames=1")
    with_goal = world.reset(0)["pixels"][0, 0].astype(int)
    green = (with_goal[..., 1] - with_goal[..., 0]) > 60
    assert 8 < green.sum() < 200


@pytest.mark.parametrize(
    ("task", "observe", "message"),
    [
        ("duel", "camera", r"a camera shows one arm, but 'duel' has 2 seats"),
        ("reach", "camera:rig=none.json", "none.json: the file does not exist"),
        ("reach", "pixels:rig=none.json", "unknown setting 'rig'"),
        ("reach", "camera:size=20", "size: 20 is not one of"),
    ],
)
def test_what_a_camera_cannot_show_is_named(task, observe, message):
    with pytest.raises(ValueError, match=message):
        ah.make_world(task, observe=observe)


def test_obstacles_are_named():
    obstacle = {"obstacles": [[0.2, 0.0, 0.05]]}
    with pytest.raises(ValueError, match="a camera does not show obstacles"):
        ah.make_world("reach", observe="camera", options=obstacle)


def test_a_rig_without_a_lens_or_of_another_table_is_named(tmp_path):
    path = rig_of(tmp_path)
    with pytest.raises(ValueError, match=r"the rig's 'full_size'; pass options"):
        ah.make_world("reach", observe=f"camera:rig={path}")
    text = path.read_text()
    path.write_text(text.replace('"lens"', '"glass"'))
    with pytest.raises(ValueError, match=r"observe: .*rig.json: view.*lens"):
        ah.make_world("reach", observe=f"camera:rig={path}")


def test_ppo_does_not_learn_from_a_camera():
    with pytest.raises(ValueError, match='clone recordings with algo="bc"'):
        ah.train("touch", observe="camera")
