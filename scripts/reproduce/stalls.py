"""Measure how much the puck rests in games between equal players, and the goals.

    python scripts/reproduce/stalls.py

All seats have the same player. A puck rests if it is slower than 0.05 m/s. It is pinned
if it touches both a paddle and a wall, within 2 mm. It rests in a corner if two walls
are within 6 cm of it. Serves after a foul or a rest are those that no goal caused.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from rows import DATA, Again, Book, Cell, Row, RowsFile, fill_and_print

from marl_airhockey.build import build_world
from marl_airhockey.registry import make_scenario
from marl_airhockey.sim.world.world import World
from marl_airhockey.toolkit.rewards import CORNER, SLOW
from marl_airhockey.types import Array

PLAYERS = {
    "duel": ("zoo/duel", "allround"),
    "doubles": ("zoo/doubles", "allround"),
    "free_for_all": ("zoo/free_for_all", "allround", "striker", "goalkeeper"),
}
"""Players by game."""
GAMES, SEED, NEAR = 200, 7_000_000, 2e-3
"""Number of games, first seed, and distance of a contact, m."""
FIELDS = (
    *("game", "player", "rests", "rests_in_corner", "pinned", "goals_per_minute"),
    *("other_serves_per_minute", "decided"),
)
BOOK = Book(DATA / "stalls.csv", FIELDS[:2])


def measure(game: str, player: str) -> Row:
    """Return the row of games between equal players."""
    seats = range(len(make_scenario(game).scene.seats))
    drivers = dict.fromkeys((f"paddle_{i}" for i in seats), player)
    world = build_world(game, GAMES, False, {"drivers": drivers})
    world.reset([*range(SEED, SEED + GAMES)])
    live, idle = np.ones(GAMES, bool), np.zeros((GAMES, 0, 2))
    steps = rests = cornered = pinned = serves = goals = decided = 0
    while live.any():
        conceded = goals_of(world)
        result = world.step(idle)
        steps += live.sum()
        resting = live & (speed_of(world) < SLOW)
        rests += resting.sum()
        cornered += (resting & ((walls_of(world) < CORNER).sum(-1) > 1)).sum()
        pinned += (live & is_pinned(world)).sum()
        serve = world.memory["serve"].reshape(GAMES, -1)
        served = (serve >= 0.0) if game == "free_for_all" else (serve != 0.0)
        serves += (live & served.any(-1)).sum()
        goals += (goals_of(world) - conceded)[live].sum()
        decided += (live & world.episode.success.any(-1)).sum()
        live &= ~(result.terminated | result.truncated)
    world.close()
    minutes = steps * world.control_dt / 60
    values = (
        *(rests / steps, cornered / steps, pinned / steps, goals / minutes),
        *((serves - goals) / minutes, decided / GAMES),
    )
    numbers = (round(float(value), 3) for value in values)
    return dict(zip(FIELDS, (game, player, *numbers), strict=True))


def goals_of(world: World) -> Array:
    """Return the number of goals so far in each world (B,)."""
    memory = world.memory
    if "lives" in memory:
        return np.asarray(-memory["lives"].sum(-1))
    return np.asarray(memory["goals"].sum(-1))


def speed_of(world: World) -> Array:
    """Return the speed of the puck before a serve in each world (B,), m/s."""
    return np.asarray(np.hypot(*world.judged.puck_velocity[:, 0].T))


def is_pinned(world: World) -> Array:
    """Return True (B,) where the puck touches a paddle and a wall before a serve."""
    state, table = world.judged, world.scene.table
    puck = state.puck[:, 0]
    gap = np.linalg.norm(state.paddle - puck[:, None], axis=-1).min(-1)
    touches = gap < table.paddle_radius + table.puck_radius + NEAR
    return np.asarray(touches & (walls_of(world) < NEAR).any(-1))


def walls_of(world: World) -> Array:
    """Return the distances of the puck from the walls before a serve (B, sides), m."""
    table = world.scene.table
    distance = world.judged.puck[:, 0] @ table.normals.T + table.offsets
    return np.asarray(distance - table.puck_radius)


def main(
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Measure the games that have no row, then print the table."""
    book = BOOK.at(rows)
    cells: list[Cell] = [(game, name) for game in PLAYERS for name in PLAYERS[game]]
    fill_and_print(book, cells, measure, jobs, again)


if __name__ == "__main__":
    typer.run(main)
