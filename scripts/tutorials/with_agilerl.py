"""Train independent PPO with AgileRL: each paddle has a policy, each game a process.

    python -m venv .venv-agilerl
    .venv-agilerl/bin/pip install torch 'agilerl==2.58.0' peft -e .
    .venv-agilerl/bin/python scripts/tutorials/with_agilerl.py --steps 20000

AgileRL needs a PettingZoo below 1.27, so it has a separate environment.
"""

from __future__ import annotations

import time
from typing import Annotated

import numpy as np
import torch
import typer
from agilerl.algorithms import IPPO
from agilerl.training.train_multi_agent_on_policy import train_multi_agent_on_policy
from agilerl.vector import AsyncPettingZooVecEnv

import marl_airhockey as ah


def main(
    game: Annotated[str, typer.Option(help="Name of a scenario.")] = "rally",
    steps: Annotated[
        int, typer.Option(help="Number of steps, summed over all games.")
    ] = 20_000,
    worlds: Annotated[
        int, typer.Option(help="Number of processes, with one game each.")
    ] = 2,
) -> None:
    """Train and print the sum of rewards of the evaluations."""
    torch.set_num_threads(1)
    env = AsyncPettingZooVecEnv([lambda: ah.parallel_env(game) for _ in range(worlds)])
    agents = env.possible_agents
    learner = IPPO(
        [env.single_observation_space(agent) for agent in agents],
        [env.single_action_space(agent) for agent in agents],
        agent_ids=agents,
        learn_step=1024,
        batch_size=256,
        lr=1e-3,
    )
    began = time.perf_counter()
    _, fitness = train_multi_agent_on_policy(
        env,
        game,
        "IPPO",
        [learner],
        max_steps=steps,
        evo_steps=steps // 4,
        eval_steps=300,
        verbose=False,
    )
    seconds = time.perf_counter() - began
    print(f"{game}: {steps:,} steps at {steps / seconds:,.0f} per second")
    print("sum of rewards of an evaluation:", np.round(np.ravel(fitness), 2))
    env.close()


if __name__ == "__main__":
    typer.run(main)
