"""Behaviour cloning from pixels: pictures of recordings, the run, its ONNX policy."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

import torch

import marl_airhockey as ah
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.relabel import relabelled
from marl_airhockey.learn.image_export import save_image_policy
from marl_airhockey.learn.image_networks import NETWORKS, ImageActor
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.offline.pixels import recorded_steps, shifted
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.policy import Policy
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.replay import Replay

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


@pytest.mark.parametrize(
    ("profile", "observe"),
    [
        ("ideal", "pixels:size=64"),
        ("gantry", "pixels:size=64"),
        ("gantry", "camera:size=64"),
    ],
)
def test_images_of_a_recording_are_those_that_were_observed(tmp_path, profile, observe):
    player, keywords = make_driver("zoo/hit_goal"), {"profile": profile}
    form = {"observe": "velocity"} if profile == "ideal" else {}
    path = record_episodes(
        player, "zoo", "hit_goal", 3, tmp_path / "a", 3, {**keywords, **form}
    )
    data = recorded_steps([path], observe, 0, 1.0)
    env = ah.gym_env("hit_goal", observe=observe, **keywords)
    row = 0
    for seed in (3, 4, 5):
        seen, _ = env.reset(seed=seed)
        done = False
        while not done:
            images, actions = data.at(np.array([row]))
            shown = seen if isinstance(seen, dict) else {"pixels": seen}
            known = images if isinstance(images, dict) else {"pixels": images}
            for name, part in known.items():
                np.testing.assert_array_equal(part[0], shown[name])
            seen, _, terminated, truncated, _ = env.step(actions[0])
            done, row = terminated or truncated, row + 1
    assert row == len(data.action)


def test_a_share_of_the_steps_is_of_the_best_episodes(expert):
    episodes = read_recording(expert).episodes
    best = max(episodes, key=lambda e: e.columns["reward"].sum())
    data = recorded_steps([expert], "pixels", 0, 0.34)
    np.testing.assert_array_equal(
        data.action,
        best.columns["action"][:, 0].astype(np.float32).clip(-1, 1),
    )


@pytest.mark.parametrize("observe", ["pixels", "camera"])
def test_a_run_from_images_goes_on_and_leaves_an_onnx_policy(expert, tmp_path, observe):
    config = offline_config("bc", [expert], {**SMALL, "observe": observe})
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
    assert (policy.observe, policy.shape) == (observe, (84, 84, 3))
    weights = torch.load(tmp_path / "last.pt", weights_only=True)
    actor = ImageActor((84, 84, 3), "small", [16], 4 if observe == "camera" else 0)
    actor.load_state_dict(weights["model"])
    rng = np.random.default_rng(0)
    seen = rng.integers(0, 256, (5, 84, 84, 3), np.uint8)
    if observe == "camera":
        seen = {"pixels": seen, "agent_pos": rng.normal(size=(5, 4))}
    expected = actor.predict(seen, True).clip(-1, 1)
    np.testing.assert_allclose(policy.predict(seen, True), expected, atol=1e-4)
    found = ah.evaluate(tmp_path, episodes=2)
    assert (found.scenario, found.episodes) == ("hit_goal", 2)


def test_what_pixels_cannot_do_is_named(expert, tmp_path):
    with pytest.raises(ValueError, match="bc alone, not iql"):
        offline_config("iql", [expert], SMALL)
    path = record_episodes(
        make_driver("still"), "x", "hit_goal", 1, tmp_path, 3, {"goals": "dict"}
    )
    with pytest.raises(ValueError, match='goals="flat"'):
        offline_config("bc", [path], SMALL)


@pytest.mark.parametrize("network", NETWORKS)
def test_an_onnx_model_acts_like_its_network(network, tmp_path):
    shape = (48, 48, 2)
    torch.manual_seed(0)
    actor = ImageActor(shape, network, [8])
    for norm in (m for m in actor.modules() if isinstance(m, torch.nn.GroupNorm)):
        torch.nn.init.normal_(norm.weight)
        torch.nn.init.normal_(norm.bias)
    card = {"observe": "pixels:size=48,frames=2"}
    parts = actor.features, actor.head, shape
    save_image_policy(*parts, card, tmp_path / "a.onnx")
    policy = ah.load_policy(tmp_path / "a.onnx")
    images = np.random.default_rng(0).integers(0, 256, (3, *shape), np.uint8)
    expected = actor.predict(images, True).clip(-1, 1)
    np.testing.assert_allclose(policy.predict(images, True), expected, atol=1e-4)


def test_an_unknown_network_is_named(expert, tmp_path):
    config = offline_config("bc", [expert], {**SMALL, "network": "vit"})
    with pytest.raises(ValueError, match="unknown network 'vit'"):
        run_training(config, tmp_path)


def test_shifted_images_are_crops_of_images_with_repeated_edges():
    images = np.arange(25, dtype=np.uint8).reshape(1, 5, 5, 1).repeat(200, 0)
    found = shifted(images, 2, np.random.default_rng(0))
    padded = np.pad(images[0], ((2, 2), (2, 2), (0, 0)), "edge")
    crops = [padded[y : y + 5, x : x + 5] for y in range(5) for x in range(5)]
    seen = {crop.tobytes() for crop in found}
    assert seen == {crop.tobytes() for crop in crops}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shift": -1}, r"shift: -1 must be in 0 \.\. 16"),
        ({"observe": "velocity", "network": "resnet18"}, "they belong to images"),
        ({"observe": "velocity", "shift": 2}, "they belong to images"),
    ],
)
def test_settings_that_do_not_fit_are_named(expert, changes, message):
    with pytest.raises(ValueError, match=message):
        offline_config("bc", [expert], {**SMALL, **changes})


def image_policy():
    def predict(images, deterministic):
        return np.zeros((len(images), 2))

    return Policy(predict, (36, 36, 3), "pixels:size=36", "mine")


def test_a_recording_of_an_image_policy_has_the_usual_observations(tmp_path):
    path = record_episodes(image_policy(), "mine", "touch", 2, tmp_path / "a", 0, {})
    recording = read_recording(path)
    assert recording.head["observe"] == "velocity"
    replayed = Replay(recording).episodes(["observation"])
    for episode, again in zip(recording.episodes, replayed, strict=True):
        found, expected = (e.columns["observation"] for e in (episode, again))
        np.testing.assert_array_equal(found, expected)


def test_a_relabelled_recording_of_images_has_observations(tmp_path):
    keywords = {"observe": "pixels:size=36"}
    player = make_driver("still")
    path = record_episodes(player, "still", "touch", 1, tmp_path / "a", 0, keywords)
    assert "observation" not in read_recording(path).episodes[0].columns
    relabelled(path, "touch", tmp_path / "b", {})
    (episode,) = read_recording(tmp_path / "b").episodes
    assert episode.columns["observation"].shape[-1] > 4


def test_another_observation_type_than_in_training_is_named():
    for player, observe in (("zoo/touch", "pixels"), (image_policy(), "velocity")):
        with pytest.raises(ValueError, match=r"trained with observe=.*; omit observe"):
            ah.evaluate(player, "touch", episodes=1, observe=observe)
