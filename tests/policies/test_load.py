"""Policies of all kinds as drivers."""

import numpy as np
import onnx
import pytest
from runs import SMALL
from stable_baselines3 import PPO, SAC

import marl_airhockey as ah
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.sb3 import build_model
from marl_airhockey.policies.load import load_policy
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.runs import RUN_FORMAT
from marl_airhockey.registry import make_driver


def test_a_policy_plays_the_same_deterministically_and_samples_otherwise(touch_run):
    mean = evaluate(load_policy(touch_run), "touch", episodes=40)
    again = evaluate(load_policy(touch_run), "touch", episodes=40)
    assert mean.returns == again.returns
    sampled = load_policy(touch_run, deterministic=False)
    assert evaluate(sampled, "touch", episodes=40).returns != mean.returns


def test_a_policy_of_another_scenario_is_refused(touch_run):
    with pytest.raises(ValueError, match="expects observations of shape"):
        evaluate(load_policy(touch_run), "juggle", episodes=2)


def test_a_policy_is_shown_without_its_numbers():
    shown = repr(make_driver("zoo/duel"))
    assert "NumpyPolicy(24 -> 128 -> 128 -> 2)" in shown
    assert len(shown) < 500


def test_any_sb3_zip_whose_spaces_fit_drives(tmp_path):
    env = ah.make_sb3_vec("reach", 2)
    for kind, extra in ((PPO, {"n_steps": 8, "batch_size": 16}), (SAC, {})):
        path = tmp_path / f"{kind.__name__}.zip"
        kind("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, **extra).save(path)
        result = evaluate(load_policy(path, trust=True), "reach", episodes=5)
        assert result.episodes == 5


def test_a_policy_of_a_run_of_another_format_is_refused(sb3_run, tmp_path):
    model = PPO.load(sb3_run / "last.zip", device="cpu")
    assert model.card["run_format"] == RUN_FORMAT
    del model.card["run_format"]
    model.save(tmp_path / "last.zip")
    for path in (tmp_path, tmp_path / "last.zip"):
        with pytest.raises(ValueError, match=r"last\.zip: .*another version"):
            load_policy(path)


def onnx_policy(path, size, outputs, batch="batch", inputs=1, kind=None):
    weight = np.full((size, outputs), 0.01, np.float32)
    helper, kind = onnx.helper, kind or onnx.TensorProto.FLOAT
    types = {onnx.TensorProto.FLOAT: np.float32, onnx.TensorProto.DOUBLE: np.float64}
    more = [f"memory_{i}" for i in range(1, inputs)]
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["observation", "weight"], ["action"])],
        "policy",
        [
            helper.make_tensor_value_info(name, kind, [batch, size])
            for name in ("observation", *more)
        ],
        [helper.make_tensor_value_info("action", kind, [batch, outputs])],
        [onnx.numpy_helper.from_array(weight.astype(types[kind]), "weight")],
    )
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=9), path)


def test_an_onnx_policy_whose_spaces_fit_drives(tmp_path):
    onnx_policy(tmp_path / "good.onnx", 8, 2)
    driver = load_policy(tmp_path / "good.onnx")
    assert evaluate(driver, "reach", episodes=5).episodes == 5
    with pytest.raises(ValueError, match="expects observations"):
        evaluate(driver, "touch", episodes=2)


def test_an_onnx_policy_of_a_fixed_batch_gets_a_row_at_a_time(tmp_path):
    onnx_policy(tmp_path / "any.onnx", 8, 2)
    onnx_policy(tmp_path / "one.onnx", 8, 2, batch=1)
    every, one = (load_policy(tmp_path / f"{name}.onnx") for name in ("any", "one"))
    rows = np.random.default_rng(0).normal(size=(5, 8)).astype(np.float32)
    np.testing.assert_allclose(every.predict(rows, True), one.predict(rows, True))
    assert evaluate(one, "reach", episodes=3).episodes == 3


@pytest.mark.parametrize(
    ("made", "words"),
    [
        ({"outputs": 3}, r"expected actions of shape \(2, 2\), got \(2, 3\)"),
        (
            {"batch": 64},
            "its batch size is fixed to 64: export it with a dynamic first axis",
        ),
        ({"inputs": 2}, r"expected one input, float32 \(B, D\); found 2 inputs"),
        ({"kind": onnx.TensorProto.DOUBLE}, r"found tensor\(double\) of shape"),
    ],
)
def test_an_onnx_model_that_is_no_policy_is_refused_when_loaded(tmp_path, made, words):
    onnx_policy(tmp_path / "wrong.onnx", **{"size": 8, "outputs": 2, **made})
    with pytest.raises(ValueError, match=words):
        load_policy(tmp_path / "wrong.onnx")


def test_a_policy_can_sit_in_any_seat_by_its_path(touch_run):
    world = ah.make_world("touch", 2, drivers={"paddle_0": str(touch_run)})
    world.reset(0)
    world.step(np.zeros((2, 0, 2)))
    assert np.abs(world.command).max() > 0


def test_an_exported_policy_is_one_small_file(tmp_path):
    config = preset("reach", SMALL)
    env = ah.make_sb3_vec("reach", 32, backend="numba")
    from marl_airhockey.policies.sb3 import numpy_actor

    model = build_model(config, env)
    numpy_actor(model.policy.state_dict(), {"scenario": "reach"}).save(
        tmp_path / "policy.npz"
    )
    assert (tmp_path / "policy.npz").stat().st_size < 300_000
    driver = make_driver(tmp_path / "policy.npz")
    seen = env.reset()
    mean = model.predict(seen, deterministic=True)[0]
    np.testing.assert_allclose(
        np.clip(driver.predict(seen, True), -1, 1), mean, atol=1e-5
    )
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="is not a policy file"):
        NumpyPolicy.load(tmp_path / "bad.npz")
