"""Pufferlib's emulation: every agent of every game as a row of one array.

    python -m venv .venv-pufferlib
    .venv-pufferlib/bin/pip install pufferlib-core -e .
    .venv-pufferlib/bin/python scripts/tutorials/with_pufferlib.py --game doubles

`pufferlib-core` is the part of pufferlib that steps environments; it brings a torch of
its own choice, so it has an environment of its own.
"""

from __future__ import annotations

import time
from typing import Annotated

import pufferlib.emulation
import pufferlib.vector
import typer

import marl_airhockey as ah


def main(
    game: Annotated[str, typer.Option(help="A scenario.")] = "doubles",
    worlds: Annotated[int, typer.Option(help="Games at once.")] = 4,
    steps: Annotated[int, typer.Option(help="Steps of all games.")] = 500,
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
    print(f"{game}: {rate:,.0f} steps of agents per second, {ended} ends of agents")
    envs.close()


if __name__ == "__main__":
    typer.run(main)
