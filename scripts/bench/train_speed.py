"""Measure trained steps per second on the CPU and, if there is one, on a GPU.

    python scripts/bench/train_speed.py --out docs/data/train_speed.json

Each row is a short training with the preset of a scenario, in a process of its own. A
step is counted with its share of the update. Only the second half of the training is
measured, so that compilation is not. Devices take turns in each round, and values are
medians over the rounds.
"""

from __future__ import annotations

import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Annotated

import typer

STEPS = {"juggle": 2_000_000, "duel": 1_000_000}
"""Number of steps of the training, by scenario."""
THREADS = (1, 4, 16)
"""Numbers of threads that step the worlds."""


def devices() -> dict[str, str]:
    """Return the names of CPU and GPU, by the names of their devices for torch."""
    import torch

    found = {"cpu": platform.processor() or platform.machine()}
    if torch.cuda.is_available():
        found["cuda"] = torch.cuda.get_device_name()
    return found


def rates(scenario: str, device: str, threads: int) -> tuple[float, float]:
    """Return the trained steps per second, and per CPU-second, of one training."""
    settings = {
        "total_steps": STEPS[scenario],
        "evaluations": 2,
        "eval_episodes": 4,
        "device": device,
    }
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        words = [part for k, v in settings.items() for part in ("--set", f"{k}={v}")]
        command = [sys.executable, "-m", "marl_airhockey.cli.main", "train", scenario]
        subprocess.run(
            [*command, "--out", str(out), *words, "--json"],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "MARL_AIRHOCKEY_THREADS": str(threads)},
        )
        with (out / "evaluations.csv").open() as file:
            first, last = list(csv.DictReader(file))

    def gained(column: str) -> float:
        return float(last[column]) - float(first[column])

    evaluation = gained("evaluation_cpu_seconds")
    seconds = gained("wall_seconds") - evaluation
    return (
        gained("steps") / seconds,
        gained("steps") / gained("learning_cpu_seconds"),
    )


def main(
    out: Annotated[Path | None, typer.Option(help="JSON file of the rows.")] = None,
    rounds: Annotated[int, typer.Option(help="Number of rounds.")] = 3,
    scenarios: Annotated[
        str, typer.Option(help="Names of scenarios, separated by commas.")
    ] = ",".join(STEPS),
) -> None:
    """Measure and print."""
    names = devices()
    counts = [n for n in THREADS if n <= (os.cpu_count() or 1)]
    cells = [
        (scenario, device, threads)
        for scenario in scenarios.split(",")
        for threads in counts
        for device in names
    ]
    found: dict[tuple[str, str, int], list[tuple[float, float]]] = {
        cell: [] for cell in cells
    }
    for _ in range(rounds):
        for cell in cells:
            found[cell].append(rates(*cell))
    rows = []
    for (scenario, device, threads), pairs in found.items():
        per_second, per_cpu_second = (
            median(column) for column in zip(*pairs, strict=True)
        )
        rows.append(
            {
                "scenario": scenario,
                "device": names[device],
                "threads": threads,
                "steps_per_s": round(per_second),
                "steps_per_cpu_s": round(per_cpu_second),
            }
        )
        print(rows[-1], flush=True)
    if out is not None:
        out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    typer.run(main)
