"""How the cost of a step of the batched backend grows, as a table and a picture.

    python scripts/bench_scaling.py --out docs/images/scaling.png

Whole env-steps of `juggle` against the number of worlds; physics alone, in 1024 worlds,
against pucks, blocks and paddles. CPU time, median over turns.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import matplotlib
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.backend import Command
from marl_airhockey.cast import Cast
from marl_airhockey.physics import PARAMETERS
from marl_airhockey.registry import find_backend
from marl_airhockey.starts import first_state
from marl_airhockey.table import TABLES, make_seat

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Turn = Callable[[], float]
"""Steps for a while and gives nanoseconds of CPU for a step of one world."""
WORLDS = (1, 4, 16, 64, 256, 1024, 4096, 16384, 65536)
BATCH = 1024
LAPSE = 20
"""Steps between two fresh starts."""


def whole(worlds: int) -> Turn:
    """A whole env-step: physics, rules, observation, restarts."""
    world = ah.make_world("juggle", worlds, backend="batched")
    world.reset(0)
    drawn = np.random.default_rng(0).uniform(-1, 1, (16, worlds, 1, 2))

    def turn() -> float:
        steps, began = 0, time.process_time()
        while steps < 16 or steps * worlds < 100_000:
            world.step(drawn[steps % 16])
            steps += 1
        return (time.process_time() - began) / steps / worlds * 1e9

    return turn


def physics(paddles: int, pucks: int, blocks: int, still: bool = False) -> Turn:
    """Physics alone of discs spread over the full-size table."""
    table = TABLES["full_size"]
    seats = (make_seat("arcade", table, 0),) * paddles
    cast = Cast(table, seats, pucks=pucks, blocks=blocks, block_radius=0.0277)
    backend = find_backend("batched")(cast, BATCH, 0.05, 10)
    values = {name: np.full(BATCH, p.default) for name, p in PARAMETERS.items()}
    values["tilt"][:] = 0.0
    backend.set_physics(values, np.ones(BATCH, np.bool_))
    rng, state = np.random.default_rng(0), first_state(cast, BATCH)
    columns = [(x, y) for x in (-0.8, -0.6) for y in (-0.3, -0.1, 0.1, 0.3)]
    middle = [(x, y) for x in (-0.35, -0.2) for y in (-0.3, -0.1, 0.1, 0.3)]
    far = [
        (x, y) for x in (0.1, 0.25, 0.4, 0.55, 0.7) for y in np.linspace(-0.3, 0.3, 6)
    ]
    places = columns[:paddles] + middle[:pucks] + far[:blocks]
    state.position[:] = places
    if not still:
        angle = rng.uniform(0, 2 * np.pi, (BATCH, pucks))
        way = np.stack([np.cos(angle), np.sin(angle)], -1)
        state.velocity[:, paddles : paddles + pucks] = way
    reach = 0.0 if still else 0.5
    drawn = reach * rng.uniform(-1, 1, (2, BATCH, paddles, 2))

    def turn() -> float:
        spent, steps = 0.0, 0
        while steps < 5 * LAPSE:
            backend.start(state, np.ones(BATCH, np.bool_))
            began = time.process_time()
            for k in range(LAPSE):
                backend.step(Command(drawn[k // 4 % 2] * (1 if k % 8 < 4 else -1)))
            spent += time.process_time() - began
            steps += LAPSE
        return spent / steps / BATCH * 1e9

    return turn


def main(
    rounds: Annotated[int, typer.Option(help="Turns.")] = 5,
    out: Annotated[Path, typer.Option(help="The picture.")] = Path(
        "docs/images/scaling.png"
    ),
) -> None:
    """Measure all cases in turns, print and draw them."""
    counts, some = range(1, 9), (0, 1, 2, 5, 10, 15, 20, 25, 30)
    cases: dict[tuple[str, str], dict[int, Turn]] = {
        ("worlds", "whole env-step"): {n: whole(n) for n in WORLDS},
        ("pucks", "physics"): {n: physics(1, n, 0) for n in counts},
        ("blocks", "puck among them"): {n: physics(1, 1, n) for n in some},
        ("blocks", "all at rest"): {n: physics(1, 1, n, still=True) for n in some},
        ("paddles", "physics"): {n: physics(n, 1, 0) for n in counts},
    }
    found: dict[tuple[str, str], dict[int, list[float]]] = {
        key: {n: [] for n in turns} for key, turns in cases.items()
    }
    for _ in range(rounds + 1):
        for key, turns in cases.items():
            for n, turn in turns.items():
                found[key][n].append(turn())
    # The first turn compiles.
    costs = {
        key: {n: float(np.median(times[1:])) for n, times in rows.items()}
        for key, rows in found.items()
    }
    table = Table("against", "case", "ns of CPU per step of a world")
    for (against, case), rows in costs.items():
        cells = "  ".join(f"{n}: {cost:,.0f}" for n, cost in rows.items())
        table.add_row(against, case, cells)
    Console().print(table)
    draw(costs, out)


def draw(costs: dict[tuple[str, str], dict[int, float]], out: Path) -> None:
    """One panel for each thing that grows."""
    panels: Sequence[str] = ("worlds", "pucks", "blocks", "paddles")
    figure, grid = plt.subplots(2, 2, figsize=(8.4, 5.6), dpi=130, layout="constrained")
    inks = ("#0072B2", "#00805c")
    for axes, panel in zip(grid.flat, panels, strict=True):
        lines = {case: rows for (name, case), rows in costs.items() if name == panel}
        for (case, rows), ink in zip(lines.items(), inks, strict=False):
            numbers, times = list(rows), list(rows.values())
            axes.plot(numbers, times, color=ink, marker="o", markersize=4, label=case)
            if panel != "worlds" and numbers[0]:
                linear = [times[0] * n / numbers[0] for n in numbers]
                axes.plot(numbers, linear, ":", color="#8a8f98", label="linear")
        if panel == "worlds":
            axes.set(xscale="log", yscale="log")
        else:
            axes.set_ylim(0, None)
        unit = "ns per env-step" if panel == "worlds" else "ns per world-step"
        axes.set(xlabel=panel, ylabel=unit)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
        axes.legend(frameon=False)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out)
    plt.close(figure)


if __name__ == "__main__":
    typer.run(main)
