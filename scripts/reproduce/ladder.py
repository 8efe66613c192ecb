"""Select a ladder of players from checkpoints: each beats the one below, not always.

    python scripts/reproduce/ladder.py duel runs/games/duel-0/checkpoints/*.npz

The checkpoints play a league. The strongest one is the top of the ladder. Of all
ladders below it, the script selects the one whose neighbours score nearest to 0.75. All
scores of neighbours must be within 0.65 to 0.85. The league is saved in the folder of
the policies.

The rungs are written as ``<game>_1.npz`` (beginner), ``<game>_2.npz`` and so on, and
the strongest as ``<game>.npz``, each with a card. The table is written to
``<game>_ladder.csv``.
"""

from __future__ import annotations

import csv
from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey.evaluation.league import league
from marl_airhockey.evaluation.standings import Standings
from marl_airhockey.learn.export import export_policy
from marl_airhockey.policies.load import load_policy

WANTED, WITHIN = 0.75, (0.65, 0.85)
"""Target and range of the score of a rung against the one below."""


def find_chain(standings: Standings, rungs: int) -> list[int]:
    """Return the indices of the players of the best ladder, the weakest first.

    Raises:
        ValueError: There is no such ladder.
    """
    order = standings.order[::-1]
    top, score = order[-1], standings.score
    best, found = np.inf, []
    for below in combinations(order[:-1], rungs - 1):
        chain = [*below, top]
        steps = score[chain[1:], chain[:-1]]
        cost = float(((steps - WANTED) ** 2).sum())
        inside = (steps >= WITHIN[0]).all() and (steps <= WITHIN[1]).all()
        if inside and cost < best:
            best, found = cost, chain
    if not found:
        raise ValueError(
            f"no ladder of {rungs} players has scores within {WITHIN}; add checkpoints "
            "or choose fewer rungs"
        )
    return found


def main(
    game: Annotated[
        str, typer.Argument(help="Name of a game with teams that play each other.")
    ],
    checkpoints: Annotated[list[Path], typer.Argument(help="Paths of checkpoints.")],
    rungs: Annotated[int, typer.Option(help="Number of players.")] = 5,
    games: Annotated[int, typer.Option(help="Number of games of each pair.")] = 200,
    out: Annotated[Path, typer.Option(help="Folder of the policies.")] = Path(
        "runs/ladder"
    ),
    table: Annotated[Path, typer.Option(help="Folder of the CSV file.")] = Path(
        "docs/data"
    ),
) -> None:
    """Play the league, select the rungs, write them with cards, print the table."""
    players = {str(path): load_policy(path) for path in checkpoints}
    standings = league(game, players, games=games, exact=True)
    standings.save(out)
    chain = find_chain(standings, rungs)
    low_high = standings.score_intervals
    shown = Table("rung", "steps", "Elo", "score against the one below (95 %)")
    rows = []
    for place, number in enumerate(chain):
        last = place == rungs - 1
        name = game if last else f"{game}_{place + 1}"
        path = checkpoints[number]
        policy = export_policy(path.parents[1], out / f"{name}.npz", path)
        row = {
            "policy": f"zoo/{name}",
            "run": path.parents[1].name,
            "steps": policy.card["steps"],
            "cpu_minutes": policy.card["cpu_minutes"],
            "elo": round(float(standings.ratings[number])),
            "score_below": "",
            "low": "",
            "high": "",
        }
        if place:
            below = chain[place - 1]
            low, high = low_high[number, below]
            share = standings.score[number, below]
            row |= {"score_below": f"{share:.4f}", "low": f"{low:.4f}"}
            row |= {"high": f"{high:.4f}"}
        rows.append(row)
        shown.add_row(
            row["policy"],
            f"{row['steps']:,}",
            f"{row['elo']}",
            f"{row['score_below']} ({row['low']}..{row['high']})" if place else "",
        )
    table.mkdir(parents=True, exist_ok=True)
    with (table / f"{game}_ladder.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    Console(width=100).print(shown)


if __name__ == "__main__":
    typer.run(main)
