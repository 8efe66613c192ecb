"""The environment by LeRobot's own functions and commands."""

import json
import subprocess
import sys
from pathlib import Path

import lerobot_env_airhockey.env as hub
import numpy as np
import pytest
import torch
from lerobot.envs.factory import make_env, make_env_config
from lerobot.envs.utils import (
    _call_make_env,
    _load_module_from_path,
    _normalize_hub_result,
    check_env_attributes_and_types,
    env_to_policy_features,
    preprocess_observation,
)
from lerobot.scripts.lerobot_eval import rollout

import marl_airhockey as ah
from marl_airhockey.registry import make_scenario, scenario_names

TASKS = [name for name in scenario_names() if len(make_scenario(name).scene.seats) == 1]
STATES = "environment_state_agent_pos"
BIN = Path(sys.executable).parent


class ZooPolicy(torch.nn.Module):
    """Trained policy of this library with the methods of a policy of LeRobot."""

    def __init__(self, name):
        super().__init__()
        self.policy = ah.load_policy(name)

    def reset(self):
        """Begin an episode."""

    def select_action(self, batch):
        actions = self.policy.predict(batch["observation.state"].numpy(), True)
        return torch.as_tensor(np.asarray(actions, np.float32))


@pytest.mark.parametrize("obs_type", hub.OBSERVATIONS)
@pytest.mark.parametrize("task", TASKS)
def test_observations_have_the_declared_features(task, obs_type):
    config = make_env_config("airhockey", task=task, obs_type=obs_type)
    vector = make_env(config, n_envs=2)[task][0]
    check_env_attributes_and_types(vector)
    observation, info = vector.reset(seed=[0, 1])
    assert info["is_success"].dtype == bool
    seen = preprocess_observation(observation)
    declared = env_to_policy_features(config)
    assert declared.pop("action").shape == vector.single_action_space.shape
    assert {k: v.shape for k, v in declared.items()} == {
        k: tuple(v.shape[1:]) for k, v in seen.items()
    }
    assert vector.metadata["render_fps"] == config.fps == 20
    info = vector.step(np.zeros((2, 2), np.float32))[-1]
    assert "is_success" in info
    assert vector.call("render")[0].shape[-1] == 3
    vector.close()


def test_images_have_no_texts_and_do_not_depend_on_the_past():
    one = hub.LeRobotTask("juggle")
    first, _ = one.reset(seed=3)
    one.step(np.ones(2))
    again, _ = one.reset(seed=3)
    np.testing.assert_array_equal(first["pixels"]["table"], again["pixels"]["table"])
    one.close()


@pytest.mark.parametrize("parallel", [False, True])
def test_lerobot_counts_the_successes_of_a_trained_policy(parallel):
    config = make_env_config("airhockey", task="reach", obs_type=STATES)
    vector = make_env(config, n_envs=8, use_async_envs=parallel)["reach"][0]
    found = rollout(
        vector, ZooPolicy("zoo/reach"), *[lambda x: x] * 4, seeds=[*range(8)]
    )
    vector.close()
    assert found["success"].any(1).float().mean() > 0.9
    # A success is read where an episode ends.
    assert found["done"].any(1).all()


def test_a_file_of_the_hub_makes_environments():
    module = _load_module_from_path(hub.__file__)
    made = _call_make_env(module, n_envs=2, use_async_envs=False, cfg=None)
    vectors = _normalize_hub_result(made)
    assert vectors["juggle"][0].num_envs == 2
    vectors["juggle"][0].close()


def test_several_tasks_are_suites():
    config = make_env_config("airhockey", task="touch, puck_velocity")
    vectors = make_env(config, n_envs=1)
    assert [*vectors] == ["touch", "puck_velocity"]
    for one in vectors.values():
        one[0].close()


def test_bad_configurations_are_named():
    with pytest.raises(ValueError, match="different observations"):
        make_env(make_env_config("airhockey", task="touch,reach"))
    with pytest.raises(ValueError, match="tuch"):
        make_env_config("airhockey", task="tuch")
    with pytest.raises(ValueError, match="obs_type 'state'"):
        make_env_config("airhockey", obs_type="state")


COMMANDS = f"""
airhockey data record zoo/reach --episodes 20 --out rec
airhockey data export rec --to lerobot --name reach --out sets
lerobot-train --dataset.repo_id=reach --dataset.root=sets/reach --policy.type=act
    --policy.push_to_hub=false --policy.device=cpu --policy.chunk_size=5
    --policy.n_action_steps=5 --policy.dim_model=64 --policy.dim_feedforward=128
    --steps=200 --save_freq=200 --batch_size=16 --num_workers=0 --output_dir=act
    --wandb.enable=false
lerobot-eval --policy.path=act/checkpoints/last/pretrained_model --policy.device=cpu
    --env.type=airhockey --env.task=reach --env.obs_type={STATES}
    --eval.n_episodes=4 --eval.batch_size=4 --eval.use_async_envs=false
    --output_dir=eval
"""
"""Commands of a user, one for each unindented line."""
IMAGE_COMMANDS = """
airhockey data record zoo/reach --episodes 4 --out rec
airhockey data export rec --to lerobot --images --name reach --out sets
lerobot-train --dataset.repo_id=reach --dataset.root=sets/reach
    --dataset.video_backend=pyav --policy.type=diffusion --policy.push_to_hub=false
    --policy.device=cpu --policy.pretrained_backbone_weights=null
    --policy.use_group_norm=true --policy.down_dims=[32,64]
    --policy.num_inference_steps=2
    --steps=4 --save_freq=4 --batch_size=4 --num_workers=0 --output_dir=act
    --wandb.enable=false
lerobot-eval --policy.path=act/checkpoints/last/pretrained_model --policy.device=cpu
    --env.type=airhockey --env.task=reach --eval.n_episodes=4 --eval.batch_size=4
    --eval.use_async_envs=false --output_dir=eval
"""
"""The same commands with images."""


@pytest.mark.parametrize("commands", [COMMANDS, IMAGE_COMMANDS], ids=["act", "images"])
def test_policies_learn_from_an_exported_dataset_and_are_evaluated(commands, tmp_path):
    for line in commands.strip().replace("\n    ", " ").splitlines():
        command, *words = line.split()
        done = subprocess.run(
            [str(BIN / command), *words], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads((tmp_path / "eval/eval_info.json").read_text())
    assert len(found["per_task"][0]["metrics"]["successes"]) == 4
    assert len(list((tmp_path / "eval").rglob("*.mp4"))) == 4
