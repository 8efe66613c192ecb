"""Play duels with several observation latencies: wins, level games, goals and shots.

    python scripts/reproduce/reaction.py

A reaction is the latency with which seats observe pucks and the other paddle. Without
latency, a goalkeeper that predicts stops every shot. With latency, attack leads to
goals. The score is by goals alone: a level game, which shots on goal decide, counts as
half a win.
"""

from __future__ import annotations

from itertools import product
from typing import Annotated

import numpy as np
import typer
from rows import DATA, Again, Book, Cell, Row, RowsFile, fill_and_print

import marl_airhockey as ah
from marl_airhockey.rollouts import play as episodes

REACTIONS = (0.0, 0.05, 0.1, 0.15, 0.2)
SCRIPTS = (
    ("allround", "goalkeeper"),
    ("striker", "goalkeeper"),
    ("allround", "allround"),
)
"""Players at home and at the far end, with all reactions."""
TRAINED = (
    ("zoo/duel", "zoo/duel"),
    ("zoo/duel", "allround"),
    ("zoo/duel", "goalkeeper"),
)
"""Players with the usual reaction."""
USUAL, GAMES, SEED = 0.15, 200, 5_000_000
FIELDS = (
    *("reaction", "home", "far", "score", "level", "home_goals", "far_goals"),
    *("goals_per_minute", "goals_per_shot", "bank_shots"),
)
BOOK = Book(DATA / "reaction.csv", FIELDS[:3])


def measure(reaction: float, home: str, far: str, games: int = GAMES) -> Row:
    """Return the row of whole games of two players.

    Args:
        reaction: Observation latency, s.
        home: Name of the driver at home.
        far: Name of the driver at the far end.
        games: Number of games.
    """
    world = ah.make_world(
        "duel",
        games,
        drivers={"paddle_0": home, "paddle_1": far},
        options={"reaction": reaction},
    )
    world.autoreset = False
    world.reset(SEED)
    goals, shots = np.zeros((2, games, 2))
    minutes, banked, banks = np.zeros((3, games))
    before = world.memory["goals"].sum(-1)
    for step in episodes.play(world):
        state, now = world.state, world.memory["goals"].sum(-1)
        banked[state.touched.any((1, 2))] = 0.0
        banked += state.banked[:, 0, [1, 3]].sum(-1)
        scored, before = step.live & (now > before), now
        banks += scored & (banked > 0.0)
        banked[scored] = 0.0
        ended = step.ended
        goals[ended] = world.memory["goals"][ended]
        shots[ended] = goals[ended] + world.memory["stopped"][ended]
        minutes[ended] = state.time[ended] / 60.0
    world.close()
    level = (goals[:, 0] == goals[:, 1]).mean()
    numbers = (
        *((goals[:, 0] > goals[:, 1]).mean() + level / 2, level, *goals.mean(0)),
        *(goals.sum() / minutes.sum(), goals.sum() / max(shots.sum(), 1.0)),
        banks.sum() / max(goals.sum(), 1.0),
    )
    values = reaction, home, far, *(round(float(number), 3) for number in numbers)
    return dict(zip(FIELDS, values, strict=True))


def main(
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Measure the pairs that have no row, then print the table."""
    book = BOOK.at(rows)
    cells: list[Cell] = [(r, *pair) for r, pair in product(REACTIONS, SCRIPTS)]
    cells += [(USUAL, *pair) for pair in TRAINED]
    fill_and_print(book, cells, measure, jobs, again)


if __name__ == "__main__":
    typer.run(main)
