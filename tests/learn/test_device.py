"""Training on a device that is chosen by name."""

import numpy as np
import pytest
import torch
from runs import SMALL, rows

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.device import moved, torch_device
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy

HERE = ["cpu", *(["cuda"] if torch.cuda.is_available() else [])]
TINY = {**SMALL, "total_steps": 2048}


def test_a_device_that_is_not_there_is_named_with_a_remedy(tmp_path):
    absent = f"cuda:{torch.cuda.device_count()}"
    with pytest.raises(RuntimeError, match=f"no {absent}; install torch for CUDA"):
        torch_device(absent)
    for name in ("tpu", "cuda:x", "cuda:", "0"):
        with pytest.raises(ValueError, match="expected cpu, cuda"):
            torch_device(name)
    with pytest.raises(RuntimeError, match="GPUs"):
        run_training(preset("touch", {**TINY, "device": absent}), tmp_path / "run")
    assert not (tmp_path / "run").exists()
    with pytest.raises(ValueError, match="rllib learns on the cpu"):
        preset("touch", {"engine": "rllib", "device": "cuda"})


def test_auto_is_the_gpu_if_there_is_one():
    assert torch_device("auto").type == HERE[-1]


@pytest.mark.parametrize("device", HERE)
def test_arrays_arrive_on_the_device(device):
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    tensor = moved(array, torch.device(device))
    assert tensor.device.type == device
    assert np.array_equal(tensor.cpu().numpy(), array)


@pytest.mark.filterwarnings("ignore:You are trying to run PPO on the GPU")
@pytest.mark.parametrize("device", HERE)
@pytest.mark.parametrize("engine", ["torch", "sb3"])
def test_a_run_and_one_with_its_weights_learn(device, engine, tmp_path):
    config = preset("touch", {**TINY, "device": device, "engine": engine})
    run_training(config, tmp_path / "run")
    assert len(rows(tmp_path / "run")) == 2
    driver = load_policy(tmp_path / "run")
    assert evaluate(driver, "touch", episodes=5).episodes == 5
    further = preset("touch", {**TINY, "engine": engine, "init": str(tmp_path / "run")})
    run_training(further, tmp_path / "further")
