"""How the cost of a step of the batched backend grows, as a table and a picture.

    python scripts/bench_scaling.py --out docs/images/scaling.png

Whole env-steps of `juggle` against the number of worlds, restarts included; physics
alone, in 1024 worlds that are put back every 20 steps, against pucks, blocks and
paddles. CPU time of this process; all cases take turns, medians over the rounds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import matplotlib.pyplot as plt
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.contracts.backend import Command
from marl_airhockey.core.physics import PARAMETERS
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.table import TABLES
from marl_airhockey.evaluation.charts import DPI, INK, INKS, save, tidy
from marl_airhockey.registry import find_backend
from marl_airhockey.toolkit.starts import first_state

Play = Callable[[], tuple[float, int]]
"""Steps for a moment: CPU-seconds and calls."""
WORLDS = (1, 4, 16, 64, 256, 1024, 4096, 16384, 65536)
BATCH, LAPSE, SIGN = 1024, 20, 4
"""Worlds of physics alone; steps between two starts, and until paddles turn back."""
ROWS = np.linspace(-0.3, 0.3, 4)
PADDLES = [(x, y) for x in (-0.8, -0.6) for y in ROWS]
PUCKS = [(x, y) for x in (-0.35, -0.2) for y in ROWS[[1, 2, 0, 3]]]
BLOCKS = [(x, y) for x in np.linspace(0, 0.8, 6) for y in np.linspace(-0.25, 0.25, 5)]
"""m: where bodies start, apart from each other; the first so many are used."""
AIM = np.pi / 6
"""rad: up to so far from straight at the blocks."""


def whole(worlds: int) -> Play:
    """Env-steps of `juggle`: physics, rules, observations and restarts."""
    world = ah.make_world("juggle", worlds, backend="numba")
    world.reset(0)
    drawn = np.random.default_rng(0).uniform(-1, 1, (16, worlds, 1, 2))
    for k in range(100):  # compiles, and lets episodes fall out of step
        world.step(drawn[k % 16])
    calls = max(16, 4096 // worlds)

    def play() -> tuple[float, int]:
        began = time.process_time()
        for k in range(calls):
            world.step(drawn[k % 16])
        return time.process_time() - began, calls

    return play


def physics(
    paddles: int, pucks: int, blocks: int = 0, spread: float = np.pi, top: float = 1.0
) -> Play:
    """Physics alone on the full-size table.

    Pucks fly at about ``top`` m/s, up to ``spread`` rad from straight at the blocks.
    """
    table = TABLES["full_size"]
    seats = (make_seat("arcade", table, side=0),) * paddles
    scene = Scene(table, seats, pucks=pucks, blocks=blocks, block_radius=0.0277)
    kind = find_backend("numba")
    backend = kind(scene, BATCH, 0.05, kind.default_substeps)
    everywhere = np.arange(BATCH)
    values = {name: np.full(BATCH, p.default) for name, p in PARAMETERS.items()}
    backend.set_physics({**values, "tilt": np.zeros(BATCH)}, everywhere)
    state, rng = first_state(scene, BATCH), np.random.default_rng(0)
    state.position[:] = PADDLES[:paddles] + PUCKS[:pucks] + BLOCKS[:blocks]
    angle = rng.uniform(-spread, spread, (BATCH, pucks))
    speed = top * rng.uniform(0.8, 1.2, (BATCH, pucks, 1))
    way = np.stack([np.cos(angle), np.sin(angle)], -1)
    state.velocity[:, paddles : paddles + pucks] = speed * way
    there = 0.5 * top * rng.uniform(-1, 1, (BATCH, paddles, 2))
    orders = Command(there), Command(-there)

    def play() -> tuple[float, int]:
        backend.start(state, everywhere)
        began = time.process_time()
        for k in range(LAPSE):
            backend.step(orders[k // SIGN % 2])
        return time.process_time() - began, LAPSE

    play()
    return play


def clocked(play: Play, seconds: float) -> float:
    """CPU-seconds of a call, over a turn of so many; never without a call."""
    spent, calls = play()
    while spent < seconds:
        more, steps = play()
        spent, calls = spent + more, calls + steps
    return spent / calls


def draw(costs: dict[tuple[str, str], dict[int, float]], out: Path) -> None:
    """A panel for each thing that grows; ``costs`` in ns per step of a world."""
    figure, grid = plt.subplots(2, 2, figsize=(8.4, 6.2), dpi=DPI, layout="constrained")
    panels = dict.fromkeys(name for name, _ in costs)
    for axes, panel in zip(grid.flat, panels, strict=True):
        lines = {case: rows for (name, case), rows in costs.items() if name == panel}
        for (case, rows), ink in zip(lines.items(), (INK, INKS[-1]), strict=False):
            axes.plot(
                *zip(*rows.items(), strict=True), "o-", ms=4, color=ink, label=case
            )
        rows = next(iter(lines.values()))
        numbers, times = np.array(list(rows)), list(rows.values())
        straight, label = times[0] * numbers, "linear from the first"
        what, unit = "Physics alone", "world-step"
        axes.set_xlabel(f"{panel} in a world")
        if panel == "worlds":
            straight, label = np.full(len(rows), times[0]), "B calls of one world"
            what, unit = "Whole env-step of juggle", "env-step"
            axes.set(xscale="log", yscale="log", xlabel="worlds B in a call of step")
        else:
            if panel == "blocks":
                straight = times[0] + (times[1] - times[0]) / numbers[1] * numbers
                label = "linear from the first two"
            axes.set_ylim(0, None)
        axes.plot(numbers, straight, ":", color=INKS[0], label=label)
        axes.set(ylabel=f"CPU, ns per {unit}", title=f"{what}, by {panel}")
        tidy(axes)
    save(figure, out)


def main(
    rounds: Annotated[int, typer.Option(min=1, help="Turns of every case.")] = 7,
    seconds: Annotated[float, typer.Option(help="CPU-seconds per point.")] = 1.0,
    out: Annotated[Path, typer.Option(help="The picture.")] = Path(
        "docs/images/scaling.png"
    ),
) -> None:
    """Measure all cases in turns, print and draw them."""
    some, many = range(1, 9), range(0, 31, 5)
    cases: dict[tuple[str, str], dict[int, Play]] = {
        ("worlds", "1 paddle, 1 puck"): {n: whole(n) for n in WORLDS},
        ("pucks", "1 paddle, n pucks"): {n: physics(1, n) for n in some},
        ("blocks", "puck flies at them"): {n: physics(1, 1, n, AIM) for n in many},
        ("blocks", "all at rest"): {n: physics(1, 1, n, top=0.0) for n in many},
        ("paddles", "n paddles, 1 puck"): {n: physics(n, 1) for n in some},
    }
    found = {(key, n): np.zeros(rounds) for key in cases for n in cases[key]}
    for turn in range(rounds):
        for key, n in found:
            found[key, n][turn] = clocked(cases[key][n], seconds / rounds)
    table = Table("against", "case", "number", "us per call", "ns per world-step")
    costs: dict[tuple[str, str], dict[int, float]] = {key: {} for key in cases}
    for (key, n), times in found.items():
        call, worlds = float(np.median(times)), n if key[0] == "worlds" else BATCH
        costs[key][n] = call / worlds * 1e9
        table.add_row(*key, f"{n}", f"{call * 1e6:,.1f}", f"{costs[key][n]:,.0f}")
    Console().print(table)
    draw(costs, out)


if __name__ == "__main__":
    typer.run(main)
