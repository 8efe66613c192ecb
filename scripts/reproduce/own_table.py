"""Compare policies that were trained for one table with those trained for all.

    airhockey fit-table play.csv --base ur5e ... --out lab.toml  # see docs/fitting.md
    python scripts/reproduce/own_table.py lab.toml --lab-seed 3 --tasks juggle

The table is that of the virtual lab, whose true physics parameters only this script
reads. It prints them with the intervals of the profile. It trains policies with the
profile and with `ur5e`, or resumes those in the folder. They play on the true table in
simulation. Camera and arm are those of the profile, which were measured. Differences
have 95 % intervals over the seeds of a method and their episodes.

These commands let the same policies play in the lab, through camera and robot:

    airhockey lab --seed 3 &
    airhockey trials lab=runs/own-table/juggle-lab-0 ... ur5e=runs/own-table/... \
        -s juggle --backend real --lab
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey.build import build_driven_world
from marl_airhockey.evaluation.comparison import (
    Comparison,
    Estimates,
    Outcomes,
    compare,
)
from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.evaluation.measures import COLUMNS, EpisodeStatistics
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.world import LabWorld
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.core.physics import SIMULATED
from marl_airhockey.sim.core.profiles import find_profile
from marl_airhockey.sim.world.keywords import Keywords

OPTIONS = {"table": LabSetup().table}
EPISODES = 1000
"""Number of episodes of each policy."""


def true_laws(lab_seed: int) -> dict[str, float]:
    """Return the physics of the lab's table, without sensing and actuation."""
    laws = LabWorld(LabSetup(), lab_seed).laws
    return {k: float(v[0]) for k, v in laws.items() if k not in SIMULATED}


def train_one(task: str, profile: str, seed: int, folder: Path) -> Path:
    """Train a policy, or resume it, and return its folder."""
    place = folder / f"{task}-{Path(profile).stem}-{seed}"
    changes = {"profile": profile, "options": OPTIONS, "seed": seed}
    known = (place / "config.toml").exists()
    run_training(None if known else preset(task, changes), place)
    print(place, flush=True)
    return place


def play(task: str, runs: list[Path], keywords: Keywords) -> Outcomes:
    """Return the outcomes of policies, each in the same episodes."""
    found = []
    for run in runs:
        world = build_driven_world(load_policy(run), task, EPISODES, keywords)
        played = play_episodes(world, EPISODES, TEST_SEED, COLUMNS)
        found.append(EpisodeStatistics(played, world.control_dt))
        world.close()
    policy = np.repeat(np.arange(len(runs)), EPISODES)
    success = np.concatenate([each.success for each in found]).astype(float)
    returns = np.concatenate([each.returns for each in found])
    return Outcomes(policy, success, returns, np.zeros(len(policy)))


def print_laws(profile: str, laws: dict[str, float]) -> None:
    """Print the true value and the range in the profile of each physics parameter."""
    table = Table("law", "true", "profile")
    for name, (low, high) in find_profile(profile).ranges.items():
        if name in laws:
            table.add_row(name, f"{laws[name]:.4f}", f"{low:.4f} .. {high:.4f}")
    Console().print(table)


def print_result(task: str, found: Comparison) -> None:
    """Print the success and the return of both methods, and the differences."""
    table = Table(task, "success", "return")
    rows: list[tuple[str, Estimates]] = [(row.name, row) for row in found.methods]
    rows += [(f"{gap.first} - {gap.second}", gap) for gap in found.differences]
    for name, row in rows:
        cells = (
            f"{value:.3f} ({low:.3f} .. {high:.3f})"
            for value, (low, high) in (
                (row.success, row.success_interval),
                (row.returns, row.returns_interval),
            )
        )
        table.add_row(name, *cells)
    Console().print(table)


def main(
    profile: Annotated[
        Path, typer.Argument(help="Profile that `airhockey fit-table` wrote.")
    ],
    lab_seed: Annotated[
        int, typer.Option(help="Seed of the lab that was measured.")
    ] = 0,
    tasks: Annotated[
        str, typer.Option(help="Names of tasks, separated by commas.")
    ] = "juggle",
    seeds: Annotated[int, typer.Option(help="Number of policies of each profile.")] = 5,
    jobs: Annotated[int, typer.Option(help="Number of runs at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/own-table"
    ),
) -> None:
    """Train and play the policies, and print the results."""
    own, laws = str(profile), true_laws(lab_seed)
    print_laws(own, laws)
    keywords: Keywords = {"profile": own, "options": OPTIONS, "physics": laws}
    for task in tasks.split(","):
        cells = [
            (task, p, seed, folder) for seed in range(seeds) for p in (own, "ur5e")
        ]
        with ProcessPoolExecutor(jobs) as pool:
            runs = list(pool.map(train_one, *zip(*cells, strict=True)))
        methods = {profile.stem: runs[::2], "ur5e": runs[1::2]}
        outcomes = {name: play(task, of, keywords) for name, of in methods.items()}
        print_result(task, compare(outcomes))


if __name__ == "__main__":
    typer.run(main)
