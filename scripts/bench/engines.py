"""Measure the training throughput of the engines, in rounds.

    python scripts/bench/engines.py --rounds 3

The script needs an environment with Ray. `make test-distributed` creates one, and
`.venv-distributed/bin/python` is its interpreter. A row is one trainer after its first
iteration. It has the steps of single seats per second of wall time and per CPU-second
of all its processes, as the mean and the range over the rounds.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import torch
import typer
from rich.console import Console
from rich.table import Table
from stable_baselines3.common.logger import Logger

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.sb3 import build_model
from marl_airhockey.learn.self_play import make_training_env
from marl_airhockey.sim.core.errors import require


class Iteration(NamedTuple):
    """Steps and times, s, of an iteration of training."""

    steps: int
    wall: float
    cpu: float


def timed(work: Callable[[], tuple[int, float]]) -> Iteration:
    """Time a function that returns its steps and the CPU time of other processes, s."""
    wall, cpu = time.perf_counter(), time.process_time()
    steps, elsewhere = work()
    spent = time.process_time() - cpu + elsewhere
    return Iteration(steps, time.perf_counter() - wall, spent)


def sb3(scenario: str, worlds: int, folder: Path) -> Callable[[], Iteration]:
    """Return a function that runs an iteration of the engine "sb3"."""
    config = preset(scenario, {"num_worlds": worlds})
    env = AirHockeyVecEnv(make_training_env(config, worlds, folder))
    model = build_model(config, env)
    model.set_logger(Logger(None, []))
    steps = config.n_steps * config.slots

    def work() -> tuple[int, float]:
        model.learn(steps, reset_num_timesteps=False)
        return steps, 0.0

    return lambda: timed(work)


def rllib(
    scenario: str, worlds: int, folder: Path, runners: int
) -> Callable[[], Iteration]:
    """Return a function that runs an iteration of the engine "rllib"."""
    from marl_airhockey.learn.rllib import build_algorithm
    from marl_airhockey.learn.rllib_runner import RUNNER_CPU

    changes = {"engine": "rllib", "num_env_runners": runners, "num_worlds": worlds}
    algo = build_algorithm(preset(scenario, changes), folder)

    def work() -> tuple[int, float]:
        found = algo.train()["env_runners"]
        elsewhere = float(found[RUNNER_CPU]) if runners else 0.0
        return int(found["num_env_steps_sampled"]), elsewhere

    return lambda: timed(work)


def main(
    scenario: Annotated[str, typer.Option(help="Scenario to train.")] = "duel",
    worlds: Annotated[
        int, typer.Option(help="Number of worlds of each trainer.")
    ] = 1024,
    rounds: Annotated[int, typer.Option(help="Number of rounds.")] = 3,
    runners: Annotated[int, typer.Option(help="Largest number of env runners.")] = 2,
) -> None:
    """Measure all trainers and print a table."""
    require("ray", "distributed")
    import ray

    from marl_airhockey.learn.rllib import start_ray

    torch.set_num_threads(1)
    start_ray(2 * runners + 1)
    folder = Path(tempfile.mkdtemp())
    trainers = {"sb3": sb3(scenario, worlds, folder / "sb3")}
    for n in range(runners + 1):
        name = f"rllib, {n} env runners"
        trainers[name] = rllib(scenario, worlds, folder / str(n), n)
    measured: dict[str, list[Iteration]] = {name: [] for name in trainers}
    for i in range(rounds + 1):
        for name, train in trainers.items():
            iteration = train()
            if i:
                measured[name].append(iteration)
    table = Table("trainer", "steps per s", "range", "steps per CPU-s", "of sb3")
    base = np.mean([t.steps / t.cpu for t in measured["sb3"]])
    for name, rows in measured.items():
        wall = [t.steps / t.wall for t in rows]
        cpu = float(np.mean([t.steps / t.cpu for t in rows]))
        table.add_row(
            name,
            f"{np.mean(wall):,.0f}",
            f"{min(wall):,.0f}..{max(wall):,.0f}",
            f"{cpu:,.0f}",
            f"{cpu / base:.2f}",
        )
    Console().print(table)
    ray.shutdown()


if __name__ == "__main__":
    typer.run(main)
