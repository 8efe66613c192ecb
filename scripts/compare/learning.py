"""Compare the CPU time of the engines torch and sb3 for the same training.

    python scripts/compare/learning.py juggle --steps 1500000 --seeds 5

The engines take turns, seed by seed. Each run has a separate process and one thread.
The time is that of learning in ``evaluations.csv``, without compilation and
evaluations.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training

ENGINES = "torch", "sb3"


def measure(scenario: str, steps: int, seed: int, engine: str) -> tuple[float, float]:
    """Train once; return the CPU-seconds and the success at the end."""
    changes = {"total_steps": steps, "seed": seed, "engine": engine, "evaluations": 1}
    with tempfile.TemporaryDirectory() as folder:
        row = run_training(preset(scenario, changes), Path(folder) / "run")
    return row["learning_cpu_seconds"], row["success"]


def main(
    scenario: Annotated[str, typer.Argument(help="Name of a task.")],
    steps: Annotated[
        int, typer.Option(help="Number of steps of each run.")
    ] = 1_500_000,
    seeds: Annotated[int, typer.Option(help="Number of runs of each engine.")] = 5,
) -> None:
    """Train with both engines in turns and print medians, ranges and the ratio."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in ENGINES}
    with ProcessPoolExecutor(1, max_tasks_per_child=1) as pool:
        for seed in range(seeds):
            for name, rows in found.items():
                rows.append(pool.submit(measure, scenario, steps, seed, name).result())
    table = Table("engine", "CPU-s, median", "range", "success")
    for name, rows in found.items():
        seconds, success = np.array(rows).T
        table.add_row(
            name,
            f"{np.median(seconds):.1f}",
            f"{seconds.min():.1f}..{seconds.max():.1f}",
            f"{success.min():.2f}..{success.max():.2f}",
        )
    Console().print(table)
    ratios = [a[0] / b[0] for a, b in zip(*found.values(), strict=True)]
    print(f"{scenario}: torch takes {np.median(ratios):.2f} of sb3's CPU time")


if __name__ == "__main__":
    typer.run(main)
