"""Compare the cost of the first start of this tree with that of another checkout.

    python scripts/compare/start.py CHECKOUT

The processes of a case begin together with an empty cache of compiled code, or with one
that another scenario has filled, and take a step of one world; printed are the
CPU-seconds of all of them and the memory of the largest, the trees one after the other.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.console import Console
from rich.table import Table


class Case(NamedTuple):
    """Scenario, with its options, and the processes that start it."""

    scenario: str
    options: dict[str, Any]
    processes: int = 1
    after: str = ""
    """Scenario that has filled the cache"""


CASES = {
    "juggle": Case("juggle", {}),
    "duel": Case("duel", {}),
    "duel, 3 pucks": Case("duel", {"pucks": 3}),
    "duel, 8 pucks": Case("duel", {"pucks": 8}),
    "free_for_all, 8 sides": Case("free_for_all", {"sides": 8}),
    "juggle in 6 processes": Case("juggle", {}, processes=6),
    "duel after juggle": Case("duel", {}, after="juggle"),
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
    if case not in CASES:
        raise typer.BadParameter(f"no case {case!r}; there are {'; '.join(CASES)}")
    scenario, options, processes, after = CASES[case]
    with tempfile.TemporaryDirectory() as folder:
        where = {"PYTHONPATH": str(tree), "MARL_AIRHOCKEY_CACHE": folder}

        def begin(name: str, options: dict[str, Any]) -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                [sys.executable, "-c", START, name, json.dumps(options)],
                env={**os.environ, **where},
                stderr=subprocess.DEVNULL,
                cwd=folder,
            )

        if after:
            begin(after, {}).wait()
        children = [begin(scenario, options) for _ in range(processes)]
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
