"""Measure how players coordinate with partners of another training; print a table.

    python scripts/reproduce/coordination.py --jobs 2

Each seed is trained twice: by plain self-play, and by other-play, in which partners see
the table mirrored in half of their episodes. Each policy then plays with itself, with
the policies of the other seeds of the same method, and with scripts. A run or a row
that exists is not computed again. The gap is the loss of return with other seeds (Hu
and others, 2020).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from games import cpu_minutes, folder_of, train_all
from rich.console import Console
from rich.table import Table
from rows import DATA, Again, Book, Cell, Row, RowsFile, read

import marl_airhockey as ah
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import bootstrap

METHODS: dict[str, dict[str, Any]] = {
    "self-play": {},
    "other-play": {"mirrored_share": 0.5},
}
"""Settings by method."""
SCRIPTS = ("striker", "allround")
EPISODES, SEED = 400, 5_000_000
FIELDS = ("game", "method", "seed", "partner", "return", "success", "cpu_minutes")
BOOK = Book(DATA / "coordination.csv", FIELDS[:4])


def folder_for(out: Path, game: str, method: str, seed: object) -> Path:
    """Return the folder of a run; those of self-play are the runs of `games.py`."""
    return folder_of(out, game if method == "self-play" else f"{game}-{method}", seed)


def measure(out: Path, game: str, method: str, seed: int, partner: str) -> Row:
    """Return the row of a policy with a partner."""
    own = folder_for(out, game, method, seed)
    other = folder_for(out, game, method, partner) / "last.npz"
    found = evaluate(
        ah.load_policy(own / "last.npz"),
        game,
        episodes=EPISODES,
        seed=SEED,
        exact=True,
        drivers={"paddle_1": partner if partner in SCRIPTS else str(other)},
    )
    numbers = round(found.returns, 3), round(found.success, 4)
    minutes = round(cpu_minutes(own), 1)
    values = (game, method, seed, partner, *numbers, minutes)
    return dict(zip(FIELDS, values, strict=True))


def gaps(rows: list[Row]) -> np.ndarray:
    """Return the loss of return of each seed with the other seeds."""
    seeds = sorted({row["seed"] for row in rows})
    found = {(row["seed"], row["partner"]): float(row["return"]) for row in rows}
    return np.array(
        [
            found[a, a]
            - np.mean([(found[a, b] + found[b, a]) / 2 for b in seeds if b != a])
            for a in seeds
        ]
    )


def summary(rows: list[Row]) -> Table:
    """Return the table of means over seeds, by game and method."""
    table = Table("game", "method", "with itself", "other seeds", "gap", *SCRIPTS)
    for game, method in dict.fromkeys((row["game"], row["method"]) for row in rows):
        mine = [r for r in rows if (r["game"], r["method"]) == (game, method)]
        lost = gaps(mine)
        low, high = bootstrap(lost, lambda values: float(values.mean()))
        groups = (
            [r for r in mine if r["partner"] == r["seed"]],
            [r for r in mine if r["partner"] not in (r["seed"], *SCRIPTS)],
            *([r for r in mine if r["partner"] == name] for name in SCRIPTS),
        )
        cells = [
            f"{np.mean([float(r['return']) for r in group]):.1f} "
            f"({np.mean([float(r['success']) for r in group]):.2f})"
            for group in groups
        ]
        cells.insert(2, f"{lost.mean():.1f} ({low:.1f} .. {high:.1f})")
        table.add_row(game, method, *cells)
    return table


def main(
    games: Annotated[
        str, typer.Option(help="Names of games, separated by commas.")
    ] = "rally,team_juggle",
    seeds: Annotated[int, typer.Option(help="Number of seeds, from 0.")] = 3,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/games"),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the runs and measure the pairs that have no row, then print the table."""
    book = BOOK.at(rows)
    partners = [*map(str, range(seeds)), *SCRIPTS]
    cells: list[Cell] = [
        (game, method, seed, partner)
        for game in games.split(",")
        for method in METHODS
        for seed in range(seeds)
        for partner in partners
    ]
    missing = book.missing(cells, again)
    if not missing:
        return
    groups = dict.fromkeys(cell[:2] for cell in missing)
    runs = [
        (folder_for(out, game, method, seed), game, {"seed": seed, **METHODS[method]})
        for game, method in groups
        for seed in range(seeds)
    ]
    for _ in train_all(runs, jobs):
        pass
    book.fill(missing, partial(measure, out), jobs)
    Console(width=110).print(summary(read(book.path)))


if __name__ == "__main__":
    typer.run(main)
