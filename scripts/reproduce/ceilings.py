"""Measure what each error of a robot's senses costs a planner that knows the rest.

    python scripts/reproduce/ceilings.py

The planner waits until the puck falls into the workspace, believes in a state of the
puck, and chooses one shot by random search. It simulates each shot with the physics of
the table, and prefers shots that also succeed if the paddle is 1 mm to the side. It
plans again just before its paddle moves. The paddle follows exactly, and the world
decides about the success. Each row gives the planner one error, and the last ones all
of a profile, with the estimates of the filter.

A finished cell adds a row to ``docs/data/ceilings.csv``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer
from planner import AGAIN, FIRST, MISS, RUN_UP, Aim, Shots, plan
from rows import DATA, Again, Book, Row, RowsFile

from marl_airhockey.build import build_world
from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.sim.core.profiles import PROFILES
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.sensing.calibration import CalibrationMap
from marl_airhockey.sim.sensing.simulated_camera import SENSED
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

EXACT = dict.fromkeys(
    (
        *SENSED,
        *("angle_noise", "angle_dropout", "action_delay", "servo_time"),
        *("wall_restitution_scatter", "wall_exit_scatter"),
        *("paddle_restitution_scatter", "spin_scatter"),
    ),
    0.0,
)
"""Parameters of a world without sensing, lag and contact noise."""
FOLLOWS = {"action_delay": 0.0, "servo_time": 0.0}
"""Parameters of a paddle that follows exactly, in all rows."""
PLANNED = 0.0
"""Position x of the falling puck at which its shot is planned, m."""
WORLDS = 16
"""Number of worlds that are planned together."""


@dataclass(frozen=True)
class Case:
    """Row of the table: what the planner lacks."""

    profile: str = "ur5e"
    physics: Mapping[str, Any] = field(default_factory=lambda: EXACT)
    """Physics parameters that replace those of the profile."""
    sees_spin: bool = True
    """True if the planner knows the spin of the puck."""
    knows: bool = True
    """True if the planner knows the restitution of the episode."""
    map_error: tuple[float, float] = (0.0, 0.0)
    """Range of the systematic error of the puck's position, m."""
    estimates: bool = False
    """True if the planner gets the estimates of the filter and the mean physics."""


SCATTER = {k: v for k, v in EXACT.items() if k != "paddle_restitution_scatter"}
CASES: dict[str, Case] = {
    "nothing": Case(),
    "map": Case(map_error=PROFILES["ur5e"].ranges["calibration_error"]),
    "spin": Case(sees_spin=False),
    "restitution of the episode": Case(knows=False),
    "restitution of each hit": Case(physics=SCATTER),
    "all of ur5e": Case(physics=FOLLOWS, estimates=True),
    "all of ur5e-calibrated": Case("ur5e-calibrated", FOLLOWS, estimates=True),
}
"""Cases by name."""


def belief(world: World, case: Case, maps: CalibrationMap, rows: Array) -> Array:
    """Return the pucks (W, 5) in which the planner believes, in some worlds."""
    state = world.state
    if case.estimates:
        state = world.sensor.estimated(world.sensed)
    place = maps.shifted(np.ascontiguousarray(state.puck[rows]), rows)[:, 0]
    spin = state.puck_edge[rows, :1] * case.sees_spin
    return np.concatenate([place, state.puck_velocity[rows, 0], spin], -1)


def laws_of(world: World, case: Case, rows: Array) -> dict[str, Array]:
    """Return the physics parameters (W,) in which the planner believes."""
    laws = {name: value[rows] for name, value in world.known.physics.items()}
    unknown = list(laws) if case.estimates else []
    if not case.knows:
        unknown = ["paddle_restitution"]
    for name in unknown:
        low, high = world.physics.ranges[name]
        laws[name] = np.full(len(rows), (low + high) / 2)
    return laws


def maps_of(world: World, case: Case) -> CalibrationMap:
    """Return the errors of the planner's camera in all worlds."""
    count = world.num_worlds
    maps = CalibrationMap(count, float(world.scene.table.size[1]))
    every = np.arange(count)
    rng = RandomStreams.keyed(TEST_SEED + every.astype(np.uint64), every, "map")
    maps.sample(rng, rng.uniform(*case.map_error), every)
    return maps


def goals_of(world: World, rows: Array) -> dict[str, Array]:
    """Return what the shots of some worlds aim at."""
    memory = world.memory
    names = memory.keys() & {"goal", "goal_velocity"}
    found = {name: memory[name][rows] for name in names}
    if world.scene.blocks:
        found["block"] = world.state.block[rows, 0]
    return found


def begin_shots(world: World, rows: Array, shots: Shots) -> None:
    """Put the paddles of some worlds on their way to the contact."""
    state, velocity = world.state.map(lambda x: x[rows]), shots.velocity[rows]
    left = (shots.time[rows] - state.time)[:, None]
    state.position[:, 0] = shots.contact[rows] - left * velocity
    state.velocity[:, 0] = velocity
    memory = {name: array[rows] for name, array in world.memory.items()}
    world.set_state(state, memory, rows)


def play(task: str, name: str, episodes: int) -> Row:
    """Return the row of a task and a case."""
    case, one = CASES[name], {} if task == "hit_goal_velocity" else {"shots": 1}
    keywords: Keywords = {
        "profile": case.profile,
        "physics": dict(case.physics),
        "options": one,
        "observe": "estimate" if case.estimates else "velocity",
    }
    world = build_world(task, episodes, False, keywords)
    world.reset(TEST_SEED)
    maps, rng = maps_of(world, case), np.random.default_rng(TEST_SEED)
    top, shots = world.physics.highest("paddle_speed"), Shots.none(episodes)
    waits, moves = np.ones(episodes, np.bool_), np.zeros(episodes, np.bool_)
    over, success = np.zeros(episodes, np.bool_), np.zeros(episodes, np.bool_)

    def choose(chosen: Array, widths: tuple[float, ...]) -> None:
        for rows in batches(chosen):
            pucks, laws = belief(world, case, maps, rows), laws_of(world, case, rows)
            aim = Aim(world.scenario, goals_of(world, rows), laws)
            middle = shots.draw[rows]
            found = plan(world, pucks, aim, MISS[task], middle, widths, rng)
            shots.draw[rows], shots.velocity[rows] = found.draw, found.velocity
            shots.contact[rows] = found.contact
            shots.time[rows] = world.state.time[rows] + found.time

    while not over.all():
        state = world.state
        falls = (state.puck[:, 0, 0] < PLANNED) & (state.puck_velocity[:, 0, 0] < 0.0)
        first = waits & falls & ~over
        waits &= ~first
        choose(np.flatnonzero(first), FIRST)
        left = shots.time - state.time
        soon = (left > 0.0) & (left < RUN_UP + world.control_dt) & ~moves & ~over
        choose(np.flatnonzero(soon & ~first), AGAIN)
        left = shots.time - state.time
        moves &= left > 0.0
        begin = np.flatnonzero((left < RUN_UP) & (left > 0.0) & ~moves & ~over)
        if len(begin):
            begin_shots(world, begin, shots)
            moves[begin] = True
        result = world.step((shots.velocity / top * moves[:, None])[:, None])
        ends = (result.terminated | result.truncated) & ~over
        success[ends] = result.success[ends, 0]
        over |= ends
    world.close()
    rate = float(success.mean())
    low, high = interval(rate, episodes)
    figures = {"success": rate, "low": low, "high": high}
    return {"task": task, "lacks": name, "episodes": episodes} | {
        key: round(value, 4) for key, value in figures.items()
    }


def batches(rows: Array) -> list[Array]:
    """Return indices in parts of at most `WORLDS`."""
    return [rows[k : k + WORLDS] for k in range(0, len(rows), WORLDS)]


def place(row: Row) -> tuple[int, int]:
    """Return the position of a row in the file."""
    return list(MISS).index(row["task"]), list(CASES).index(row["lacks"])


BOOK = Book(DATA / "ceilings.csv", ("task", "lacks"), place)


def main(
    episodes: Annotated[int, typer.Option(help="Number of episodes of a cell.")] = 500,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Play all cells and save their rows."""
    book = BOOK.at(rows)
    cells = [(task, name) for task in MISS for name in CASES]
    work = partial(play, episodes=episodes)
    book.fill(book.missing(cells, again), work, jobs)


if __name__ == "__main__":
    typer.run(main)
