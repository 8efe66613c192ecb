"""Compare the cost of the first start of this tree with that of another checkout.

    python scripts/compare/start.py CHECKOUT

A case is a scenario, its options and a number of processes, each with one world. They
begin together with an empty cache of compiled code and take a step; printed are the
CPU-seconds of all of them and the memory of the largest, the trees one after the other.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

CASES: dict[str, tuple[str, dict[str, Any], int]] = {
    "juggle": ("juggle", {}, 1),
    "duel": ("duel", {}, 1),
    "duel, 3 pucks": ("duel", {"pucks": 3}, 1),
    "duel, 8 pucks": ("duel", {"pucks": 8}, 1),
    "free_for_all, 8 sides": ("free_for_all", {"sides": 8}, 1),
    "juggle in 6 processes": ("juggle", {}, 6),
}
START = """
import json, sys
import numpy as np
import marl_airhockey as ah

world = ah.make_world(sys.argv[1], 1, options=json.loads(sys.argv[2]))
world.reset(0)
world.step(np.zeros((1, len(world.open), 2)))
"""


def start(tree: Path, case: str) -> tuple[float, float]:
    """Start a case; return CPU-seconds and GB of memory."""
    scenario, options, processes = CASES[case]
    with tempfile.TemporaryDirectory() as folder:
        where = {"PYTHONPATH": str(tree), "MARL_AIRHOCKEY_CACHE": folder}
        children = [
            subprocess.Popen(
                [sys.executable, "-c", START, scenario, json.dumps(options)],
                env={**os.environ, **where},
                stderr=subprocess.DEVNULL,
                cwd=folder,
            )
            for _ in range(processes)
        ]
        used = [os.wait4(child.pid, 0) for child in children]
    if any(status for _, status, _ in used):
        raise typer.BadParameter(f"{case} does not start in {tree}")
    seconds = sum(usage.ru_utime + usage.ru_stime for *_, usage in used)
    return seconds, max(usage.ru_maxrss for *_, usage in used) / 2**20


def main(
    checkout: Path,
    cases: Annotated[str, typer.Option(help="Separated by semicolons.")] = "; ".join(
        CASES
    ),
) -> None:
    """Start both trees with empty caches and print what that costs."""
    table = Table("CPU-s and GB of a first start", "here", "there", "here / there")
    trees = Path(__file__).resolve().parents[2], checkout.resolve()
    for case in cases.split("; "):
        here, there = (start(tree, case) for tree in trees)
        costs = [f"{seconds:.0f}, {memory:.2f}" for seconds, memory in (here, there)]
        table.add_row(case, *costs, f"{here[0] / there[0]:.2f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    typer.run(main)
