"""Measure the success of the zoo's policies of the tasks, over independent episodes.

    python scripts/reproduce/zoo.py
    python scripts/reproduce/zoo.py --again --rows mine.csv

No policy was selected by these episodes. Each policy plays 2000 test episodes in the
environment of its training, with its mean actions. The policies of the zoo are from
other runs than those of ``tasks.py``.
"""

from __future__ import annotations

from typing import Annotated

import typer
from rows import DATA, Again, Book, Row, RowsFile

from marl_airhockey.data.benchmark.catalogue import TASKS
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.policies.load import ZOO

EPISODES = 2000
PROFILES = {"": "ideal", "_ur5e": "ur5e", "_full_size": "ur5e, the lab's table"}
"""Ends of the names of policies, and the environment of their training."""
BOOK = Book(DATA / "zoo.csv", ("policy",))


def measure(name: str) -> Row:
    """Return the row of a policy."""
    found = evaluate(f"zoo/{name}", episodes=EPISODES, name=name)
    low, high = interval(found.success, EPISODES)
    values = (name, *(f"{x:.4f}" for x in (found.success, low, high)), EPISODES)
    return dict(
        zip(("policy", "success", "low", "high", "episodes"), values, strict=True)
    )


def main(
    jobs: Annotated[int, typer.Option(help="Number of policies at a time.")] = 1,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Measure the policies that have no row."""
    book = BOOK.at(rows)
    names = [f"{task}{end}" for end in PROFILES for task in TASKS]
    cells = [(name,) for name in names if (ZOO / f"{name}.npz").exists()]
    book.fill(book.missing(cells, again), measure, jobs)


if __name__ == "__main__":
    typer.run(main)
