"""Studies of the further work that the paper announces, with one table.

    python scripts/reproduce/announced.py --seeds 3 --jobs 1
    python scripts/reproduce/announced.py --studies curriculum --seeds 3
    python scripts/reproduce/announced.py --show

A study compares policies in one environment, over 500 test seeds. `STUDIES` lists them.
The policies are trained by PPO with the preset and the changes of a case. A finished
run adds a row to ``docs/data/announced.csv``. A run that has a row is not trained
again.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rows import DATA, Again, Book, Row, RowsFile, compute, read

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy


@dataclass(frozen=True)
class Study:
    """Study: a scenario, and cases of training for it."""

    scenario: str
    cases: dict[str, Row]
    """Changes of the preset, by the name of the case."""
    options: Row = field(default_factory=dict)
    """Options of the environment in which all cases are evaluated."""
    first: str = ""
    """Scenario whose policy of the same seed initializes the cases with ``init``."""


POSTS = {"obstacles": [[0.05, 0.1, 0.04], [0.05, -0.1, 0.04]]}
AVOIDED = {"reward_regions": [[-0.55, 0.0, 0.06, -2.0]]}
STICKY = {"drag_regions": [[0.0, 0.0, 0.25, 2.0]]}
SHORT = {"total_steps": 3_000_000}
FEW = {"total_steps": 131_072, "evaluations": 4}
STUDIES = {
    "curriculum": Study(
        "hit_goal_velocity",
        {"whole ranges": SHORT, "widening ranges": {**SHORT, "curriculum": 0.1}},
    ),
    "transfer": Study(
        "puck_velocity",
        {"from scratch": FEW, "from touch": {**FEW, "init": "touch"}},
        first="touch",
    ),
    "sequence": Study("reach_sequence", {"five goals": {}}),
    "two pucks": Study(
        "juggle", {"two pucks": {"options": {"pucks": 2}}}, {"pucks": 2}
    ),
    "obstacles": Study(
        "hit_goal", {"trained without": {}, "trained with": {"options": POSTS}}, POSTS
    ),
    "reward regions": Study(
        "reach", {"trained without": {}, "trained with": {"options": AVOIDED}}, AVOIDED
    ),
    "drag regions": Study(
        "hit_goal", {"trained without": {}, "trained with": {"options": STICKY}}, STICKY
    ),
}
"""Studies by name.

* curriculum: ranges of starts that begin at a tenth and widen, or whole ranges.
* transfer: 131,072 steps from the weights of touch, or from scratch.
* sequence: five goals in turn.
* two pucks: juggling of two pucks.
* obstacles: two posts in front of the goals.
* reward regions: a disc in the workspace with a reward of -2 per second.
* drag regions: a disc in the middle of the table with a drag of 2 1/s.
"""
EPISODES = 500
ROWS = DATA / "announced.csv"
KEY = ("study", "case", "seed")


def train_case(name: str, case: str, seed: int, folder: Path) -> Row:
    """Train a case of a study and return its row."""
    study = STUDIES[name]
    changes = {"seed": seed, **study.cases[case]}
    if "init" in changes:
        first = folder / f"{study.first}-{seed}"
        changes["init"] = str(train(study.first, {"seed": seed}, first))
    place = folder / f"{name}-{case}-{seed}".replace(" ", "_")
    train(study.scenario, changes, place)
    row = read(place / "evaluations.csv")[-1]
    found = evaluate(
        load_policy(place / "last.npz"),
        study.scenario,
        episodes=EPISODES,
        name=case,
        exact=True,
        options=study.options,
    )
    return {
        **dict(zip(KEY, (name, case, seed), strict=True)),
        "success": round(found.success, 4),
        "return": round(found.returns, 3),
        "steps": int(row["steps"]),
        "cpu_minutes": round(float(row["learning_cpu_seconds"]) / 60, 2),
    }


def train(scenario: str, changes: Row, place: Path) -> Path:
    """Train a run, or resume it, or use it if it is finished; return its folder."""
    config = preset(scenario, changes)
    run_training(None if (place / "config.toml").exists() else config, place)
    return place


def order(row: Row) -> tuple[int, int]:
    """Return the sort key of a row."""
    cases = [(name, case) for name, study in STUDIES.items() for case in study.cases]
    return cases.index((row["study"], row["case"])), int(row["seed"])


def table() -> list[list[str]]:
    """Return the cells of the table of all studies, beginning with the header."""
    found, rows = [["study", "case", "success", "return", "steps", "seeds"]], read(ROWS)
    for name, study in STUDIES.items():
        for case in study.cases:
            own = [row for row in rows if (row["study"], row["case"]) == (name, case)]
            if own:
                mean, back = (
                    float(np.mean([float(row[column]) for row in own]))
                    for column in ("success", "return")
                )
                low, high = interval(mean, EPISODES)
                share = f"{mean:.3f} ({low:.3f} .. {high:.3f})"
                steps = f"{int(own[0]['steps']) / 1e6:.2f} M"
                found.append([name, case, share, f"{back:.2f}", steps, str(len(own))])
    return found


BOOK = Book(ROWS, KEY, order)


def main(
    studies: Annotated[
        str, typer.Option(help="Names of studies, separated by commas.")
    ] = ",".join(STUDIES),
    seeds: Annotated[int, typer.Option(help="Number of runs of each case.")] = 1,
    jobs: Annotated[int, typer.Option(help="Number of runs at a time.")] = 1,
    folder: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/announced"
    ),
    show: Annotated[
        bool, typer.Option(help="Print the table without training.")
    ] = False,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the runs that have no row."""
    if show:
        for k, cells in enumerate(table()):
            print(f"| {' | '.join(cells)} |")
            if k == 0:
                print(f"| {' | '.join(['---'] * len(cells))} |")
        return
    wanted = [
        (name, case, seed)
        for seed in range(seeds)
        for name in studies.split(",")
        for case in STUDIES[name].cases
    ]
    compute(BOOK.at(rows), wanted, train_case, folder, jobs, again)


if __name__ == "__main__":
    typer.run(main)
