"""Behaviour cloning from pixels: pictures of recordings, the run, its ONNX policy."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

import torch

import marl_airhockey as ah
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.offline.pixels import PixelActor, render_pictures
from marl_airhockey.learn.train import run_training
from marl_airhockey.registry import make_driver

SMALL = {
    **{"observe": "pixels", "total_steps": 200, "batch_size": 16, "hidden": [16]},
    **{"evaluations": 2, "eval_episodes": 4},
}


@pytest.fixture(scope="module")
def expert(tmp_path_factory):
    player, folder = (
        make_driver("zoo/hit_goal"),
        tmp_path_factory.mktemp("pixels") / "a",
    )
    record_episodes(player, "zoo/hit_goal", "hit_goal", 3, folder, 3, {})
    return folder


def test_pictures_of_a_recording_are_those_that_pixels_show(expert):
    scene = ah.make_scenario("hit_goal").scene
    data = render_pictures([expert], scene, 0, 1.0)
    env = ah.gym_env("hit_goal", observe="pixels")
    row = 0
    for seed in (3, 4, 5):
        seen, _ = env.reset(seed=seed)
        done = False
        while not done:
            shown = data.frames[data.shown[row]].permute(1, 2, 0).numpy()
            np.testing.assert_array_equal(shown, seen)
            seen, _, terminated, truncated, _ = env.step(data.action[row].numpy())
            done, row = terminated or truncated, row + 1
    assert row == len(data.action)


def test_a_share_of_the_pictures_is_of_the_best_episodes(expert):
    scene = ah.make_scenario("hit_goal").scene
    episodes = read_recording(expert).episodes
    best = max(episodes, key=lambda e: e.columns["reward"].sum())
    data = render_pictures([expert], scene, 0, 0.34)
    np.testing.assert_array_equal(
        data.action.numpy(),
        best.columns["action"][:, 0].astype(np.float32).clip(-1, 1),
    )


def test_a_run_from_pixels_goes_on_and_leaves_an_onnx_policy(expert, tmp_path):
    config = offline_config("bc", [expert], SMALL)
    calls = []

    def stop(done, total, row):
        calls.append(done)
        if done == total:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_training(config, tmp_path, stop)
    row = run_training(None, tmp_path)
    assert row["steps"] == 200
    policy = ah.load_policy(tmp_path / "last.onnx")
    assert (policy.observe, policy.shape) == ("pixels", (84, 84, 3))
    weights = torch.load(tmp_path / "last.pt", weights_only=True)
    actor = PixelActor([16])
    actor.load_state_dict(weights["model"])
    pictures = np.random.default_rng(0).integers(0, 256, (5, 84, 84, 3), np.uint8)
    with torch.inference_mode():
        expected = actor(torch.from_numpy(pictures).float()).clamp(-1, 1).numpy()
    np.testing.assert_allclose(policy.predict(pictures, True), expected, atol=1e-4)
    found = ah.evaluate(tmp_path, episodes=2)
    assert (found.scenario, found.episodes) == ("hit_goal", 2)


def test_what_pixels_cannot_do_is_named(expert, tmp_path):
    with pytest.raises(ValueError, match="bc alone, not iql"):
        offline_config("iql", [expert], SMALL)
    player = make_driver("zoo/touch")
    keywords = {"profile": "ur5e"}
    path = record_episodes(player, "x", "touch", 1, tmp_path / "b", 3, keywords)
    with pytest.raises(ValueError, match="profile ideal"):
        offline_config("bc", [path], SMALL)
