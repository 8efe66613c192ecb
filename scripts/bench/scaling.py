"""Measure the growth of the cost of a step of the numba backend: a table and a plot.

    python scripts/bench/scaling.py --out docs/images/scaling.png

The first case is whole environment steps of `juggle` against the number of worlds,
including resets. The others are physics alone against the number of pucks, blocks and
paddles, in 1024 worlds that are reset every 20 steps. Times are CPU time of this
process. Each case is measured once per round, and values are medians over the rounds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.render.charts import SOFT, panels, save, series

Steps = Callable[[], tuple[float, int]]
"""Function that makes some steps and returns the CPU-seconds and the number of
calls."""
WORLDS = (1, 4, 16, 64, 256, 1024, 4096, 16384, 65536)
BATCH, EPISODE, REVERSAL = 1024, 20, 4
"""Worlds of physics alone; steps between two resets; steps until paddles reverse."""
ROWS = np.linspace(-0.3, 0.3, 4)
PADDLES = [(x, y) for x in (-0.8, -0.6) for y in ROWS]
PUCKS = [(x, y) for x in (-0.35, -0.2) for y in ROWS[[1, 2, 0, 3]]]
BLOCKS = [(x, y) for x in np.linspace(0, 0.8, 6) for y in np.linspace(-0.25, 0.25, 5)]
"""Initial positions of bodies, m, without contact. The first ones of each list are
used."""
AIM = np.pi / 6
"""Largest angle between the velocity of a puck and the direction of the blocks, rad."""


def env_steps(worlds: int) -> Steps:
    """Return environment steps of `juggle`: physics, rules, observations and resets."""
    world = ah.make_world("juggle", worlds, backend="numba")
    world.reset(0)
    actions = np.random.default_rng(0).uniform(-1, 1, (16, worlds, 1, 2))
    for k in range(100):  # Compile the code and desynchronize the episodes.
        world.step(actions[k % 16])
    calls = max(16, 4096 // worlds)

    def step() -> tuple[float, int]:
        began = time.process_time()
        for k in range(calls):
            world.step(actions[k % 16])
        return time.process_time() - began, calls

    return step


def physics(
    paddles: int, pucks: int, blocks: int = 0, spread: float = np.pi, top: float = 1.0
) -> Steps:
    """Return steps of physics alone on the full-size table.

    Pucks move at about ``top`` m/s, up to ``spread`` rad off the direction of the
    blocks.
    """
    table = TABLES["full_size"]
    seats = (make_seat("arcade", table, side=0),) * paddles
    scene = Scene(table, seats, pucks=pucks, blocks=blocks, block_radius=0.0277)
    kind = find_backend("numba")
    backend = kind(scene, BATCH, 0.05)
    everywhere = np.arange(BATCH)
    values = {name: np.full(BATCH, p.default) for name, p in PARAMETERS.items()}
    backend.set_physics({**values, "tilt": np.zeros(BATCH)}, everywhere)
    state, rng = scene.still_state(BATCH), np.random.default_rng(0)
    state.position[:] = PADDLES[:paddles] + PUCKS[:pucks] + BLOCKS[:blocks]
    angle = rng.uniform(-spread, spread, (BATCH, pucks))
    speed = top * rng.uniform(0.8, 1.2, (BATCH, pucks, 1))
    direction = np.stack([np.cos(angle), np.sin(angle)], -1)
    state.velocity[:, paddles : paddles + pucks] = speed * direction
    forth = 0.5 * top * rng.uniform(-1, 1, (BATCH, paddles, 2))
    still = Command.still(scene, BATCH)
    commands = still._replace(velocity=forth), still._replace(velocity=-forth)

    def step() -> tuple[float, int]:
        backend.reset(state, everywhere)
        began = time.process_time()
        for k in range(EPISODE):
            backend.step(commands[k // REVERSAL % 2])
        return time.process_time() - began, EPISODE

    step()
    return step


def seconds_per_call(step: Steps, seconds: float) -> float:
    """Return the CPU-seconds of a call, over at least ``seconds`` and one call."""
    spent, calls = step()
    while spent < seconds:
        more, further = step()
        spent, calls = spent + more, calls + further
    return spent / calls


def plot_costs(
    costs: dict[tuple[str, str], dict[int, tuple[float, float, float]]],
    out: Path,
    rounds: int,
) -> None:
    """Plot one panel for each number that grows.

    Args:
        costs: CPU time of a step of a world, ns: median, least and most of the rounds,
            by number, by panel and case.
        out: PNG file.
        rounds: Number of rounds.
    """
    figure, grid = panels(2, 2, (8.4, 6.6))
    names = dict.fromkeys(name for name, _ in costs)
    for axes, panel in zip(grid.flat, names, strict=True):
        lines = {case: rows for (name, case), rows in costs.items() if name == panel}
        for k, (case, rows) in enumerate(lines.items()):
            look, (middle, low, high) = series(k), np.transpose(list(rows.values()))
            axes.errorbar(
                *(list(rows), middle, (middle - low, high - middle)),
                markersize=4,
                label=case,
                **look.style,
            )
        rows = next(iter(lines.values()))
        numbers, times = np.array(list(rows)), [middle for middle, *_ in rows.values()]
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
        axes.plot(numbers, straight, ":", color=SOFT, label=label)
        axes.set(ylabel=f"CPU, ns per {unit}", title=f"{what}, by {panel}")
        axes.legend(frameon=False, fontsize="small")
    save(figure, out, f"Median and range of n = {rounds} rounds", legend=False)


def main(
    rounds: Annotated[int, typer.Option(min=1, help="Number of rounds.")] = 7,
    seconds: Annotated[float, typer.Option(help="CPU-seconds of each point.")] = 1.0,
    out: Annotated[Path, typer.Option(help="PNG file of the plot.")] = Path(
        "docs/images/scaling.png"
    ),
) -> None:
    """Measure all cases in rounds, print and plot them."""
    some, many = range(1, 9), range(0, 31, 5)
    cases: dict[tuple[str, str], dict[int, Steps]] = {
        ("worlds", "1 paddle, 1 puck"): {n: env_steps(n) for n in WORLDS},
        ("pucks", "1 paddle, n pucks"): {n: physics(1, n) for n in some},
        ("blocks", "puck flies at them"): {n: physics(1, 1, n, AIM) for n in many},
        ("blocks", "all at rest"): {n: physics(1, 1, n, top=0.0) for n in many},
        ("paddles", "n paddles, 1 puck"): {n: physics(n, 1) for n in some},
    }
    found = {(key, n): np.zeros(rounds) for key in cases for n in cases[key]}
    for round_ in range(rounds):
        for key, n in found:
            found[key, n][round_] = seconds_per_call(cases[key][n], seconds / rounds)
    table = Table("against", "case", "number", "us per call", "ns per world-step")
    costs: dict[tuple[str, str], dict[int, tuple[float, float, float]]] = {
        key: {} for key in cases
    }
    for (key, n), times in found.items():
        call, worlds = float(np.median(times)), n if key[0] == "worlds" else BATCH
        each = (call, times.min(), times.max())
        middle, low, high = (float(time / worlds * 1e9) for time in each)
        costs[key][n] = middle, low, high
        table.add_row(*key, f"{n}", f"{call * 1e6:,.1f}", f"{costs[key][n][0]:,.0f}")
    Console().print(table)
    plot_costs(costs, out, rounds)


if __name__ == "__main__":
    typer.run(main)
