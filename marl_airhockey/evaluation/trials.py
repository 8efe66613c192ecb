"""Trials: comparison of policies on one table, from the same starts and in turns.

Changes in the course of a day, such as a warmer table or a more skilled operator,
affect all policies alike. The operator, who puts the puck on the table, need not know
which policy plays.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.evaluation.measures import COLUMNS, measure
from marl_airhockey.evaluation.trial_sheet import TrialRow, TrialSheet
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.driven_seat import DrivenSeat
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array, Memory

DRAWS = 20
"""Number of sampled starts for each start that is chosen."""
FAR = 1e3
"""Magnitude from which an element of the memory does not describe the table."""
ROUNDS = 12
"""Number of iterations of the algorithm that spreads the starts."""


def play_trials(
    world: World,
    sheet: TrialSheet,
    drivers: dict[str, list[Driver]],
    done: Callable[[int], None] = lambda trials: None,
) -> None:
    """Play the trials of a table that have no row yet, and write their rows.

    Args:
        world: Batch of one world on the table of the plan, before its first episode,
            with a driver at ``paddle_0``.
        sheet: Table of the trials.
        drivers: Drivers of ``paddle_0``, by name of the method and index of the policy.
        done: Function that is called with the number of finished trials.

    Raises:
        ValueError: A driver cannot play in this world.
    """
    plan, own = sheet.plan, world.driven[0]
    with ExitStack() as stack:
        stack.callback(world.driven.__setitem__, 0, own)
        # All drivers take the seat before the first episode, when the memory of their
        # observations begins.
        seats = {
            (name, k): _seat(world, driver, stack)
            for name, policies in drivers.items()
            for k, driver in enumerate(policies)
        }
        for trial, (start, name, k) in enumerate(plan.trials):
            done(trial)
            if trial < len(sheet.rows):
                continue
            world.driven[0] = seats[name, k]
            began = datetime.now(UTC)
            (episode,) = play_episodes(world, 1, plan.starts[start], COLUMNS)
            found = measure(episode, world.control_dt)
            sheet.add(
                TrialRow(
                    trial=trial,
                    start=start,
                    code=plan.codes[name],
                    policy=k,
                    success=int(found.success),
                    returns=found.returns,
                    seconds=found.length * world.control_dt,
                    touches=found.touches,
                    began=began.isoformat(timespec="milliseconds"),
                    ended=datetime.now(UTC).isoformat(timespec="milliseconds"),
                    reason=found.interruption,
                )
            )
        done(len(plan.trials))


def _seat(world: World, driver: Driver, stack: ExitStack) -> DrivenSeat:
    """Return a seat with a driver at ``paddle_0``; the stack closes the driver."""
    seat = DrivenSeat(0, driver, world.observer, 1, world.control_dt)
    stack.push(driver.__exit__)
    return seat


def spread_starts(world: World, count: int) -> list[int]:
    """Return seeds of starts that are spread over everything that a scenario samples.

    They are spread over positions, velocities and goals, each divided by its standard
    deviation.

    Args:
        world: Batch of one world, which is left at some start.
        count: Number of starts.
    """
    seeds = TEST_SEED + np.arange(DRAWS * count)
    starts = np.stack([_start(world, int(seed)) for seed in seeds])
    deviation = starts.std(0)
    drawn = deviation > 1e-9
    chosen = spread(starts[:, drawn] / deviation[drawn], count)
    return [int(seed) for seed in seeds[chosen]]


def spread(points: Array, count: int) -> Array:
    """Return indices of points (n, m) that are spread over all points, all different.

    They are the points nearest to the means of Lloyd's algorithm (1982).
    """
    nearest = np.arange(count)
    for _ in range(ROUNDS):
        means = points[nearest]
        closest = _distances(points, means).argmin(1)
        # If all points are equal, the first mean is nearest to all of them.
        means = np.stack(
            [
                points[closest == k].mean(0) if k in closest else means[k]
                for k in range(count)
            ]
        )
        nearest = _nearest(points, means)
    return nearest


def write_starts(world: World, seeds: list[int], path: Path) -> None:
    """Write positions of puck and paddle at starts as CSV, for marks on the table."""
    bodies = [f"paddle_{i}" for i in range(len(world.scene.seats))]
    bodies += [f"puck_{i}" for i in range(world.scene.pucks)]
    columns = [f"{body}_{axis}_m" for body in bodies for axis in "xy"]
    with path.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["start", "seed", *columns])
        for k, seed in enumerate(seeds):
            state, _ = _drawn(world, seed)
            places = np.concatenate([state.paddle[0], state.puck[0]]).ravel()
            rows.writerow([k, seed, *(f"{x:.3f}" for x in places)])


def _drawn(world: World, seed: int) -> tuple[State, Memory]:
    """Return the state and the memory of the start of a seed."""
    world.seed(seed)
    world.draw_worlds(np.array([0]))
    return world.get_state()


def _start(world: World, seed: int) -> Array:
    """Return the numbers that describe the start of a seed."""
    state, memory = _drawn(world, seed)
    drawn = [value for value in memory.values() if value.dtype.kind == "f"]
    parts = [state.position, state.velocity, *drawn]
    row = np.concatenate([part[0].ravel() for part in parts])
    # Times of events that have not occurred yet are very large, or nan.
    return np.where(np.abs(row) < FAR, row, 0.0)


def _distances(points: Array, means: Array) -> Array:
    return np.asarray(np.square(points[:, None] - means).sum(-1))


def _nearest(points: Array, means: Array) -> Array:
    """Return the index of the point nearest to each mean, without repetition."""
    distances = _distances(points, means)
    found: list[int] = []
    for k in range(len(means)):
        distances[found, k] = np.inf
        found.append(int(distances[:, k].argmin()))
    return np.array(found)
