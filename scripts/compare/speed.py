"""Compare the speed of this checkout with another installation, in rounds of one run.

    python scripts/compare/speed.py CHECKOUT
    python scripts/compare/speed.py PYTHON --empty   # interpreter with a wheel

The cases are the PettingZoo environment, 4096 worlds, and 256 worlds in which every
seat chases the puck. The backend is numba, which old checkouts (commit ec48060) name
``batched``. The script prints steps per CPU-second of a process. Each round measures
both installations one after the other, and the ratio is the median over the rounds.
"""

from __future__ import annotations

import subprocess
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import typer
from places import HERE, started
from rich.console import Console
from rich.table import Table

CASES = (
    *("juggle dict", "duel dict", "juggle 4096", "duel 4096"),
    *("duel chase", "doubles chase", "free_for_all chase"),
    *("hit_goal dict ur5e", "hit_goal 4096 ur5e"),
)
MEASURE = """
import sys, time
import numpy as np
import marl_airhockey as ah

backend = "batched" if "batched" in ah.backend_names() else "numba"
scenario, kind, *profile = sys.argv[1:]
given = {"backend": backend, **({"profile": profile[0]} if profile else {})}
if kind == "dict":
    env = ah.parallel_env(scenario, **given)
    draws = np.random.default_rng(0).uniform(-1, 1, (512, 2)).astype(np.float32)
    env.reset(seed=0)
    def play():
        for k in range(512):
            step = env.step({agent: draws[k] for agent in env.agents})
            if not env.agents:
                env.reset()
        return 512
elif kind == "chase":
    world = ah.make_world(scenario, 256, **given)
    table = world.scene.table
    turns = np.array([table.rotation(seat.side) for seat in world.scene.seats])
    world.reset(0)
    def play():
        for _ in range(4):
            gap = world.state.puck[:, :1] - world.state.paddle
            chase = 20.0 * np.einsum("skd,wsd->wsk", turns, gap)
            world.step(np.clip(chase, -1.0, 1.0))
        return 4 * 256
else:
    world = ah.make_world(scenario, int(kind), **given)
    shape = (8, int(kind), len(world.open), 2)
    draws = np.random.default_rng(0).uniform(-1, 1, shape)
    world.reset(0)
    def play():
        for actions in draws:
            world.step(actions)
        return 8 * int(kind)
for _ in range(10):
    play()
for line in sys.stdin:
    steps, began = 0, time.process_time()
    while (spent := time.process_time() - began) < float(line):
        steps += play()
    print(steps / spent, flush=True)
"""


def start(
    stack: ExitStack, place: Path, case: str, cache: str | None
) -> subprocess.Popen[str]:
    """Start a process that answers each line of seconds with steps per CPU-second."""
    python, variables = started(place, cache)
    child = subprocess.Popen(
        [python, "-c", MEASURE, *case.split()],
        env=variables,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd="/",
    )
    return stack.enter_context(child)


def ask(child: subprocess.Popen[str], seconds: float) -> float:
    """Return the steps per CPU-second of a round."""
    assert child.stdin is not None
    assert child.stdout is not None
    print(seconds, file=child.stdin, flush=True)
    return float(child.stdout.readline())


def main(
    other: Path,
    cases: Annotated[
        str, typer.Option(help="Names of cases, separated by commas.")
    ] = ",".join(CASES),
    rounds: Annotated[int, typer.Option(help="Number of rounds.")] = 9,
    seconds: Annotated[
        float, typer.Option(help="CPU-seconds of each case in a round.")
    ] = 2.0,
    empty: Annotated[
        bool,
        typer.Option(
            help="Give the other installation an empty cache of compiled code."
        ),
    ] = False,
) -> None:
    """Measure both installations and print their rates and ratios."""
    table = Table("steps per CPU-s", "here", "there", "here / there", "spread")
    # An interpreter of an environment is a link that must not be resolved.
    places = HERE, other.absolute()
    for case in cases.split(","):
        with ExitStack() as stack:
            folder = stack.enter_context(TemporaryDirectory()) if empty else None
            caches = None, folder
            children = [
                start(stack, place, case, cache)
                for place, cache in zip(places, caches, strict=True)
            ]
            rates = np.array(
                [[ask(child, seconds) for child in children] for _ in range(rounds)]
            )
            for child in children:
                assert child.stdin is not None
                child.stdin.close()
        ratio = rates[:, 0] / rates[:, 1]
        here, there = np.median(rates, axis=0)
        spread = f"{ratio.min():.2f} .. {ratio.max():.2f}"
        row = f"{here:,.0f}", f"{there:,.0f}", f"{np.median(ratio):.3f}", spread
        table.add_row(case, *row)
    Console(width=100).print(table)


if __name__ == "__main__":
    typer.run(main)
