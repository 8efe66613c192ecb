"""Compare the cost of the first start of this checkout with another installation.

    python scripts/compare/start.py CHECKOUT
    python scripts/compare/start.py PYTHON     # interpreter with a wheel

The processes of a case start together, with a cache of compiled code that is empty or
was filled by another scenario. Each makes one step of one world.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from places import HERE, started
from rich.console import Console
from rich.table import Table


class Case(NamedTuple):
    """Scenario, with its options, and the number of processes that start it."""

    scenario: str
    options: dict[str, Any]
    processes: int = 1
    after: str = ""
    """Scenario that fills the cache before; "" for an empty cache."""


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


class Cost(NamedTuple):
    """Cost of the processes of a case."""

    seconds: float
    """Time until the last process ends, s."""
    cpu_seconds: float
    """CPU-seconds of all processes."""
    memory: float
    """Memory of the largest process, GB."""


def start(place: Path, case: str) -> Cost:
    """Start a case in a checkout or with an interpreter; return the cost."""
    if case not in CASES:
        raise typer.BadParameter(f"unknown case {case!r}; known: {'; '.join(CASES)}")
    scenario, options, processes, after = CASES[case]
    with tempfile.TemporaryDirectory() as folder:
        python, variables = started(place, folder)

        def begin(name: str, options: dict[str, Any]) -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                [python, "-c", START, name, json.dumps(options)],
                env=variables,
                stderr=subprocess.DEVNULL,
                cwd=folder,
            )

        if after:
            begin(after, {}).wait()
        began = time.monotonic()
        children = [begin(scenario, options) for _ in range(processes)]
        used = [os.wait4(child.pid, 0) for child in children]
        seconds = time.monotonic() - began
    if any(status for _, status, _ in used):
        raise typer.BadParameter(f"{case} does not start with {place}")
    cpu = sum(usage.ru_utime + usage.ru_stime for *_, usage in used)
    return Cost(seconds, cpu, max(usage.ru_maxrss for *_, usage in used) / 2**20)


def main(
    other: Path,
    cases: Annotated[
        str, typer.Option(help="Names of cases, separated by semicolons.")
    ] = "; ".join(CASES),
    out: Annotated[Path | None, typer.Option(help="CSV file of the rows.")] = None,
) -> None:
    """Start this checkout and another installation; print the costs."""
    table = Table("first start: s, CPU-s, GB", "here", "there", "here / there")
    # An interpreter of an environment is a link that must not be resolved.
    places = {"here": HERE, "there": other.absolute()}
    rows = ["case,place,seconds,cpu_seconds,memory_gb"]
    for case in cases.split("; "):
        costs = {name: start(place, case) for name, place in places.items()}
        rows += [
            f'"{case}",{name},{c.seconds:.2f},{c.cpu_seconds:.2f},{c.memory:.2f}'
            for name, c in costs.items()
        ]
        texts = [
            f"{c.seconds:.1f}, {c.cpu_seconds:.1f}, {c.memory:.2f}"
            for c in costs.values()
        ]
        ratio = costs["here"].cpu_seconds / costs["there"].cpu_seconds
        table.add_row(case, *texts, f"{ratio:.2f}")
    Console(width=100).print(table)
    if out is not None:
        out.write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    typer.run(main)
