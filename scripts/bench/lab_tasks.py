"""Measure the success of policies in the five real tasks through camera and arm.

    python scripts/bench/lab_tasks.py --out docs/data/lab_tasks.csv

Each policy of the zoo for the full-size table plays 20 episodes through the lab's
camera and arm, in real time. It plays 1000 episodes on the plant alone: the same table
with the same physics, but with the true state and a paddle that follows exactly. It
also plays 1000 in the profile `ur5e`, the simulation that it was trained in. Intervals
are 95 %. The script takes about 15 minutes. Nothing else should run at the same time.
Tasks whose rows are in the file are not measured again.
"""

from __future__ import annotations

import argparse
import csv
from contextlib import closing
from pathlib import Path

from marl_airhockey.evaluation.evaluate import EvaluationResult, evaluate
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.sim.jit.folders import cache_folder
from marl_airhockey.sim.sensing.simulated_camera import SENSED

TASKS = ("reach", "reach_velocity", "touch", "juggle", "puck_velocity")
EXACT = (*SENSED, "action_delay", "servo_time")
"""Parameters that are 0 for the plant alone."""
EPISODES, SIMULATED = 20, 1000
"""Number of episodes through the lab, and of each simulation."""


def shown(result: EvaluationResult, digits: int) -> str:
    """Return a success with its interval as text."""
    low, high = result.success_interval
    return f"{result.success:.{digits}f} ({low:.{digits}f} .. {high:.{digits}f})"


def read(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file; none if there is no file."""
    if not path.exists():
        return []
    with path.open() as file:
        return list(csv.DictReader(file))


def add(rows: list[dict[str, str]], row: dict[str, str], path: Path) -> None:
    """Add a row, print it, and write all rows into a CSV file."""
    rows.append(row)
    print(row, flush=True)
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, [*row], lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def measure(task: str, rig: Path, physics: dict[str, float]) -> dict[str, str]:
    """Return the row of a task.

    Args:
        task: Name of the task.
        rig: File of the rig of the lab.
        physics: Physics parameters of the table of the lab.
    """
    policy, options = f"zoo/{task}_full_size", {"table": "full_size"}
    lab = evaluate(policy, task, episodes=EPISODES, backend="real", rig=str(rig))
    plant = evaluate(
        policy,
        task,
        episodes=SIMULATED,
        options=options,
        profile="ideal",
        physics=physics,
    )
    simulated = evaluate(
        policy, task, episodes=SIMULATED, options=options, profile="ur5e"
    )
    return {
        "task": task,
        "lab": shown(lab, 2),
        "interrupted": str(lab.interrupted),
        "plant": shown(plant, 3),
        "ur5e": shown(simulated, 3),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="CSV file of the rows.")
    out = parser.parse_args().out
    rows = read(out)
    known = {row["task"] for row in rows}
    with Lab() as lab, served(lab, announce=False) as port:
        path = cache_folder() / f"tasks-{port}.json"
        with closing(LabClient(port)) as client:
            calibrate_lab(client).save(path)
        physics = lab.ask({"do": "truth"})["laws"] | dict.fromkeys(EXACT, 0.0)
        for task in TASKS:
            if task in known:
                continue
            add(rows, measure(task, path, physics), out)
        path.unlink()


if __name__ == "__main__":
    main()
