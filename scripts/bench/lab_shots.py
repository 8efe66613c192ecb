"""Measure policies of shooting tasks through camera and arm of a fitted lab.

    python scripts/bench/lab_shots.py runs/hit_goal_lab runs/move_block_lab --seed 11

docs/robot_results.md has the commands that fit the lab and train the policies. The lab
has a marked puck and a block. Each policy plays 20 episodes
through camera and arm, in real time, and 1000 in the simulation of its training.
Intervals are 95 %. Nothing else should run at the same time. Policies whose row is in
the file are not measured again.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from lab_tasks import EPISODES, SIMULATED, add, read, shown

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.settings import load_config
from marl_airhockey.sim.jit.folders import cache_folder
from marl_airhockey.sim.world.keywords import Keywords

DATA = Path(__file__).parents[2] / "docs" / "data"


def measure(run: Path, rig: Path) -> dict[str, str]:
    """Return the row of the last policy of a run.

    Args:
        run: Folder of the run.
        rig: File of the rig of the lab.
    """
    config, policy = load_config(PPOConfig, run / "config.toml"), str(run / "last.npz")
    usual, task = config.keywords, config.scenario
    real: Keywords = {**usual, "backend": "real", "rig": str(rig)}
    lab = evaluate(policy, task, episodes=EPISODES, **real)
    simulated = evaluate(policy, task, episodes=SIMULATED, **usual)
    return {
        "task": task,
        "lab": shown(lab, 2),
        "first_shot": f"{lab.first_shot:.2f}",
        "interrupted": str(lab.interrupted),
        "profile": shown(simulated, 3),
        "profile_first_shot": f"{simulated.first_shot:.3f}",
    }


def main(
    runs: Annotated[list[Path], typer.Argument(help="Folders of the runs.")],
    seed: Annotated[int, typer.Option(help="Seed of the lab's physics.")],
    out: Annotated[Path, typer.Option(help="CSV file.")] = DATA / "lab_shots.csv",
) -> None:
    """Measure and print."""
    rows = read(out)
    known = {row["task"] for row in rows}
    setup = LabSetup(marked=True, block=True)
    with Lab(setup, seed) as lab, served(lab, announce=False) as port:
        path = cache_folder() / f"shots-{port}.json"
        with closing(LabClient(port)) as client:
            calibrate_lab(client).save(path)
        for run in runs:
            if load_config(PPOConfig, run / "config.toml").scenario in known:
                continue
            add(rows, measure(run, path), out)
        path.unlink()


if __name__ == "__main__":
    typer.run(main)
