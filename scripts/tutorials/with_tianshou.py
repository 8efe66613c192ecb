"""Train SAC with tianshou: one paddle, one task.

    python -m venv .venv-tianshou
    .venv-tianshou/bin/pip install torch 'tianshou[eval]==2.0.1' -e .
    .venv-tianshou/bin/python scripts/tutorials/with_tianshou.py --task reach --epochs 3

tianshou needs a pandas below 3, so it has a separate environment.
"""

from __future__ import annotations

import tempfile
import time
from typing import Annotated

import torch
import typer
from tianshou.highlevel.config import OffPolicyTrainingConfig
from tianshou.highlevel.env import EnvFactoryRegistered, VectorEnvType
from tianshou.highlevel.experiment import ExperimentConfig, SACExperimentBuilder

import marl_airhockey as ah
from marl_airhockey.discovery import gymnasium_id


def main(
    task: Annotated[
        str, typer.Option(help="Name of a scenario with one seat.")
    ] = "reach",
    epochs: Annotated[
        int, typer.Option(help="Number of epochs, each with an evaluation.")
    ] = 3,
    steps: Annotated[int, typer.Option(help="Number of steps of an epoch.")] = 2000,
) -> None:
    """Train, evaluate, and use the policy as a driver of a paddle."""
    torch.set_num_threads(1)
    envs = EnvFactoryRegistered(task=gymnasium_id(task), venv_type=VectorEnvType.DUMMY)
    experiment = (
        SACExperimentBuilder(
            envs,
            ExperimentConfig(
                persistence_base_dir=tempfile.mkdtemp(), watch=False, device="cpu"
            ),
            OffPolicyTrainingConfig(
                max_epochs=epochs,
                epoch_num_steps=steps,
                num_training_envs=4,
                num_test_envs=4,
                buffer_size=50_000,
                collection_step_num_env_steps=8,
                update_step_num_gradient_steps_per_sample=0.25,
                start_timesteps=500,
                batch_size=256,
            ),
        )
        .with_actor_factory_default(hidden_sizes=(64, 64))
        .with_common_critic_factory_default(hidden_sizes=(64, 64))
        .build()
    )
    began = time.perf_counter()
    result = experiment.run()
    rate = epochs * steps / (time.perf_counter() - began)
    assert result.trainer_result is not None
    print(f"{task}: {epochs * steps:,} steps at {rate:,.0f} per second")
    print(f"best return of an evaluation: {result.trainer_result.best_reward:.2f}")
    policy = result.world.algorithm.policy

    def act(observation: object) -> object:
        return policy.compute_action(observation)

    world = ah.make_world(task, drivers={"paddle_0": act})
    world.reset(seed=0)
    print("driver of paddle_0:", world.driven[0].driver)


if __name__ == "__main__":
    typer.run(main)
