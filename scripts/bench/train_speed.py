"""Measure trained steps per second on the CPU and, if there is one, on a GPU.

    python scripts/bench/train_speed.py --out docs/data/train_speed.json

Each row is a short training with the preset of a scenario, in a process of its own. The
engine "torch" steps worlds on the CPU, also if it learns on a GPU, and the engine
"device" steps them on the GPU. A step is counted with its share of the update. Only the
second half of the training is measured, so that compilation is not. The trainings take
turns in each round, and values are medians over the rounds.
"""

from __future__ import annotations

import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Annotated, Any, NamedTuple

import typer

STEPS = {"juggle": 2_000_000, "duel": 1_000_000}
"""Number of steps of the training, by scenario."""


def devices() -> dict[str, str]:
    """Return the names of CPU and GPU, by the names of their devices for torch."""
    import torch

    found = {"cpu": platform.processor() or platform.machine()}
    if torch.cuda.is_available():
        found["cuda"] = torch.cuda.get_device_name()
    return found


class Cell(NamedTuple):
    """Training that is measured."""

    scenario: str
    engine: str
    device: str
    threads: int


def cells_of(scenarios: Sequence[str], counts: list[int], gpu: bool) -> list[Cell]:
    """Return the trainings of scenarios: with threads of the CPU, and on a GPU."""
    kinds = [("torch", "cpu", n) for n in counts]
    if gpu:
        kinds += [("torch", "cuda", counts[-1]), ("device", "cuda", 1)]
    return [Cell(scenario, *kind) for scenario in scenarios for kind in kinds]


def rates(cell: Cell) -> tuple[float, float]:
    """Return the trained steps per second, and per CPU-second, of one training."""
    settings: dict[str, Any] = {
        "total_steps": STEPS[cell.scenario],
        "evaluations": 2,
        "eval_episodes": 4,
        "engine": cell.engine,
        "device": cell.device,
    }
    if cell.engine == "device" and cell.scenario == "duel":
        settings["self_play_fraction"] = 1
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        words = [part for k, v in settings.items() for part in ("--set", f"{k}={v}")]
        command = [
            sys.executable,
            "-m",
            "marl_airhockey.cli.main",
            "train",
            cell.scenario,
        ]
        subprocess.run(
            [*command, "--out", str(out), *words, "--json"],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "MARL_AIRHOCKEY_THREADS": str(cell.threads)},
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
    threads: Annotated[
        str, typer.Option(help="Numbers of threads that step worlds of the CPU.")
    ] = "1,4,16",
) -> None:
    """Measure and print."""
    names = devices()
    counts = [int(n) for n in threads.split(",") if int(n) <= (os.cpu_count() or 1)]
    cells = cells_of(scenarios.split(","), counts, "cuda" in names)
    found: dict[Cell, list[tuple[float, float]]] = {cell: [] for cell in cells}
    for _ in range(rounds):
        for cell in cells:
            found[cell].append(rates(cell))
    rows = []
    for cell, pairs in found.items():
        per_second, per_cpu_second = (
            median(column) for column in zip(*pairs, strict=True)
        )
        rows.append(
            {
                **cell._asdict(),
                "device": names[cell.device],
                "steps_per_s": round(per_second),
                "steps_per_cpu_s": round(per_cpu_second),
            }
        )
        print(rows[-1], flush=True)
    if out is not None:
        out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    typer.run(main)
