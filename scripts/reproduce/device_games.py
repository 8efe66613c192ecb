"""Train duel with the engine device, by self-play alone, on a CPU.

    python scripts/reproduce/device_games.py

A finished run adds a row to ``docs/data/device_games.csv``: CPU-minutes of learning,
and the score in 200 games against the policy of the zoo, with its 95 % interval. A run
that has a row is not trained again, and an interrupted run is resumed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rows import DATA, Again, Book, Row, RowsFile, compute

from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver

KEY = ("game", "seed")
GAMES = 200


def train_run(game: str, seed: int, folder: Path) -> Row:
    """Train one run and return its row."""
    changes = {"engine": "device", "self_play_fraction": 1, "seed": seed}
    place = folder / f"{game}-{seed}"
    begun = (place / "config.toml").exists()
    row = run_training(None if begun else preset(game, changes), place)
    policy, rival = load_policy(place / "last.npz"), make_driver(f"zoo/{game}")
    (score,), _ = play_against(game, policy, [rival], GAMES, TEST_SEED)
    low, high = interval(float(score), GAMES)
    return {
        "game": game,
        "seed": seed,
        "steps": int(row["steps"]),
        "cpu_minutes": round(row["learning_cpu_seconds"] / 60, 1),
        "score": round(float(score), 3),
        "low": round(low, 3),
        "high": round(high, 3),
    }


BOOK = Book(DATA / "device_games.csv", KEY, lambda row: (row["game"], int(row["seed"])))


def main(
    seeds: Annotated[int, typer.Option(help="Number of runs.")] = 2,
    jobs: Annotated[int, typer.Option(help="Number of runs at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/device_games"
    ),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the runs that have no row."""
    cells = [("duel", seed) for seed in range(seeds)]
    compute(BOOK.at(rows), cells, train_run, folder, jobs, again)


if __name__ == "__main__":
    typer.run(main)
