"""Step games with pufferlib's emulation: each agent of each game is a row of an array.

    python -m venv .venv-pufferlib
    .venv-pufferlib/bin/pip install pufferlib-core -e .
    .venv-pufferlib/bin/python scripts/tutorials/with_pufferlib.py --game doubles

`pufferlib-core` is the part of pufferlib that steps environments. It installs a torch
version of its choice, so it has a separate environment.
"""

from __future__ import annotations

import time
from typing import Annotated

import pufferlib.emulation
import pufferlib.vector
import typer

import marl_airhockey as ah


def main(
    game: Annotated[str, typer.Option(help="Name of a scenario.")] = "doubles",
    worlds: Annotated[int, typer.Option(help="Number of games in a batch.")] = 4,
    steps: Annotated[int, typer.Option(help="Number of steps of each game.")] = 500,
) -> None:
    """Step games with random actions and print the rate."""
    envs = pufferlib.vector.make(
        pufferlib.emulation.PettingZooPufferEnv,
        env_kwargs={"env_creator": lambda: ah.parallel_env(game)},
        backend=pufferlib.vector.Serial,
        num_envs=worlds,
    )
    observations, _ = envs.reset(seed=0)
    print("observations", observations.shape, "actions", envs.action_space.shape)
    ended, began = 0, time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = envs.step(envs.action_space.sample())
        ended += int((terminated | truncated).sum())
    rate = steps * len(observations) / (time.perf_counter() - began)
    print(f"{game}: {rate:,.0f} agent-steps per second, {ended} ends of agents")
    envs.close()


if __name__ == "__main__":
    typer.run(main)
