"""Train algorithms of sb3-contrib: a recurrent PPO, and TQC with hindsight goals.

    python scripts/tutorials/with_sb3_contrib.py

RecurrentPPO plays with latency and noise and observes one moment at a time, so it needs
a memory. TQC learns to reach goals that are separate from the observation
(`goals="dict"`), and relabels steps with goals that it reached. Both step our batches
of worlds without a wrapper.
"""

from __future__ import annotations

import time
from typing import Annotated, Any

import torch
import typer
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import HerReplayBuffer
from stable_baselines3.common.evaluation import evaluate_policy

import marl_airhockey as ah


def train(model: Any, name: str, steps: int, env: Any) -> None:
    """Train a model and print the mean return of an episode."""
    began = time.perf_counter()
    model.learn(steps)
    rate = model.num_timesteps / (time.perf_counter() - began)
    mean, spread = evaluate_policy(model, env, n_eval_episodes=20, warn=False)
    print(f"{name}: {model.num_timesteps:,} steps at {rate:,.0f} per second")
    print(f"{name}: mean return {mean:.2f}, standard deviation {spread:.2f}")


def main(
    steps: Annotated[
        int, typer.Option(help="Number of steps, summed over all worlds.")
    ] = 30_000,
) -> None:
    """Train both, one after the other."""
    torch.set_num_threads(1)
    juggle = ah.make_sb3_vec("juggle", 32, profile="ur5e", observe="velocity")
    recurrent = RecurrentPPO(
        "MlpLstmPolicy",
        juggle,
        n_steps=64,
        batch_size=512,
        learning_rate=1e-3,
        policy_kwargs={"lstm_hidden_size": 32, "net_arch": [32]},
        device="cpu",
    )
    train(recurrent, "RecurrentPPO", steps, juggle)
    reach = ah.make_sb3_vec("reach", 8, goals="dict")
    hindsight = TQC(
        "MultiInputPolicy",
        reach,
        replay_buffer_class=HerReplayBuffer,
        learning_starts=2000,
        train_freq=8,
        gradient_steps=8,
        policy_kwargs={"net_arch": [64, 64]},
        device="cpu",
    )
    train(hindsight, "TQC with HER", steps // 4, reach)


if __name__ == "__main__":
    typer.run(main)
