"""Measure the deepest overlap of many blocks that slide into a heap, on physics alone.

    python scripts/bench/overlaps.py --blocks 15,20,30

A paddle with random velocities, a puck and blocks are on a table that is tilted by 20
degrees. The script prints the deepest overlap of two discs, or of a disc with a wall,
at the end of any step, and the world-steps per CPU-second.
"""

from __future__ import annotations

import time
from typing import Annotated

import numpy as np
import typer
from scaling import BLOCKS, PADDLES, PUCKS

from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

WORLDS, REVERSAL = 8, 4
"""Number of worlds, and number of steps for which a paddle has the same velocity."""
TOP, SPREAD = 1.5, 0.5
"""Largest speed of a paddle, and largest initial speed of the others, along an axis,
m/s."""


def play(blocks: int, seed: int, steps: int) -> tuple[float, float]:
    """Return the deepest overlap, m, and the CPU-seconds of some steps."""
    table = TABLES["full_size"]
    seats = (make_seat("arcade", table, side=0),)
    scene = Scene(table, seats, pucks=1, blocks=blocks, block_radius=0.0277)
    backend, everywhere = find_backend("numba")(scene, WORLDS, 0.05), np.arange(WORLDS)
    values = {name: np.full(WORLDS, p.default) for name, p in PARAMETERS.items()}
    backend.set_physics({**values, "tilt": np.full(WORLDS, 20.0)}, everywhere)
    state, rng = scene.still_state(WORLDS), np.random.default_rng(seed)
    state.position[:] = PADDLES[:1] + PUCKS[:1] + BLOCKS[:blocks]
    state.velocity[:, 1:] = rng.uniform(-SPREAD, SPREAD, (WORLDS, blocks + 1, 2))
    backend.reset(state, everywhere)
    radius, still = np.array(scene.bodies.radius), Command.still(scene, WORLDS)
    one, two = np.triu_indices(len(radius), 1)
    deepest, spent = 0.0, 0.0
    for step in range(steps):
        if step % REVERSAL == 0:
            command = still._replace(velocity=rng.uniform(-TOP, TOP, (WORLDS, 1, 2)))
        began = time.process_time()
        position = backend.step(command).position
        spent += time.process_time() - began
        apart = np.linalg.norm(position[:, one] - position[:, two], axis=-1)
        inside = position[:, 1:] @ table.normals.T + table.offsets
        gaps = (apart - radius[one] - radius[two]).min(), inside.min(-1) - radius[1:]
        deepest = max(deepest, -gaps[0], -gaps[1].min())
    return deepest, spent


def main(
    blocks: Annotated[
        str, typer.Option(help="Numbers of blocks, separated by commas.")
    ] = "15,20,30",
    seeds: Annotated[
        int, typer.Option(help="Number of heaps of each number of blocks.")
    ] = 2,
    steps: Annotated[int, typer.Option(help="Number of steps of each heap.")] = 2400,
) -> None:
    """Measure each number of blocks."""
    for count in map(int, blocks.split(",")):
        found = [play(count, seed, steps) for seed in range(seeds)]
        deepest = max(depth for depth, _ in found)
        rate = seeds * steps * WORLDS / sum(seconds for _, seconds in found)
        print(f"{count} blocks: {1e3 * deepest:.3f} mm, {rate:,.0f} world-steps")


if __name__ == "__main__":
    typer.run(main)
