"""Train the population of the challenge, and measure the style of its players.

    python scripts/reproduce/population.py --train      # a new population
    python scripts/reproduce/population.py              # the table

Each style is a change of the preset of duel. The seeds are random, and neither the
policies nor the table contain them. After a training, the printed hash belongs in
`evaluation/population.py`, and the number of the protocol of the challenge increases.
"""

from __future__ import annotations

import secrets
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from games import train
from reaction import USUAL
from reaction import measure as duels
from rows import DATA, Again, Book, Row, RowsFile, fill_and_print

from marl_airhockey.evaluation.games import play_against
from marl_airhockey.evaluation.population import FOLDER, STYLES, digest
from marl_airhockey.learn.ppo_config import only_against
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.registry import find_scenario, make_driver

SIZE = {"hidden": [64, 64], "evaluations": 2, "exploiters": 0}
REWARDS = "training_options"
CHANGES: dict[str, dict[str, Any]] = {
    "attacker": {REWARDS: {"shot_weight": 0.3, "scored_weight": 2.0}},
    "keeper": {REWARDS: {"shot_weight": 0.0, "scored_weight": 0.2}},
    "banker": {"opponents": ["goalkeeper"], "scripted_fraction": 1.0},
    "soft": {"action_rate_weight": 0.02},
    "hasty": {"gamma": 0.95},
    "early": {"total_steps": 2_000_000},
    "late": {"total_steps": 16_000_000},
    "exploiter": {},
}
"""Changes of the preset by style. The exploiter trains against the late player only."""
STEPS, GAMES, SEED = 8_000_000, 400, 8_000_000
FIELDS = (
    *("style", "score", "home_goals", "far_goals", "goals_per_minute"),
    *("goals_per_shot", "bank_shots"),
)
BOOK = Book(DATA / "population.csv", FIELDS[:1])


def train_style(out: Path, style: str) -> None:
    """Train a player and save it without its seed."""
    changes = {"total_steps": STEPS, **SIZE, **CHANGES[style]}
    if style == "exploiter":
        changes |= only_against(str(FOLDER / "late.npz"))
    train(out / style, "duel", {"seed": secrets.randbelow(2**31), **changes})
    found = NumpyPolicy.load(out / style / "last.npz")
    card = {
        "run_format": found.card["run_format"],
        "scenario": "duel",
        "version": find_scenario("duel").version,
        "profile": "ideal",
        "observe": found.card["observe"],
        "labels": found.card["labels"],
        "style": style,
    }
    FOLDER.mkdir(exist_ok=True)
    NumpyPolicy(found.layers, found.centre, found.unit, found.log_std, card=card).save(
        FOLDER / f"{style}.npz"
    )


def measure(style: str) -> Row:
    """Return the row of a player in games against zoo/duel."""
    path = str(FOLDER / f"{style}.npz")
    score, _ = play_against(
        "duel", make_driver(path), [make_driver("zoo/duel")], GAMES, SEED
    )
    played = duels(USUAL, path, "zoo/duel", GAMES)
    row = {"style": style, "score": round(float(score[0]), 3)}
    return row | {name: played[name] for name in FIELDS[2:]}


def main(
    new: Annotated[
        bool, typer.Option("--train", help="Train a new population.")
    ] = False,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/population"
    ),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the players if requested, measure those without a row, print the table."""
    if new:
        with ProcessPoolExecutor(jobs, max_tasks_per_child=1) as pool:
            list(pool.map(partial(train_style, out), STYLES[:-1]))
        train_style(out, STYLES[-1])
        print(f"hash: {digest()}", flush=True)
    book = BOOK.at(rows)
    fill_and_print(book, [(style,) for style in STYLES], measure, jobs, again or new)


if __name__ == "__main__":
    typer.run(main)
