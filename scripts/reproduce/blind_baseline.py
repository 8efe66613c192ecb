"""Search for controllers that succeed in a task without observing its goal.

    python scripts/reproduce/blind_baseline.py --out docs/data/blind.csv

A task that requires aiming is useful only if controllers that do not aim fail. There
are three kinds of them:

* "stroke", for hit_goal, hit_goal_velocity and move_block: the paddle moves to a
  position that is linear in the puck's position and velocity. It strikes with a
  constant velocity when the puck is near. It has 13 numbers and never observes the goal
  or the block.
* "circle", for reach_velocity: the paddle circles the goal at an increasing speed and
  does not observe the target velocity. It has 4 numbers.
* "through", for reach: the paddle passes through the goal with one speed. It has 1
  number.

A cross-entropy search over 12 generations finds the numbers in the profile `ideal`. The
best result of three searches plays other episodes in `ideal` and, without further
tuning, in `ur5e`.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from marl_airhockey.build import build_driven_world
from marl_airhockey.cli.options import settings
from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.evaluation.measures import COLUMNS, EpisodeStatistics
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.types import Array

CANDIDATES, PLAYED, ELITE, GENERATIONS = 96, 48, 12, 12
"""Candidates of a generation, episodes of each, size of the elite whose mean is the
next mean, and number of generations."""
RESTARTS, CHECKED, CHECK_SEED = 3, 1000, 500_000
"""Number of searches, number of episodes that select the best one, and their seed."""
GAIN = 12.0
"""Speed toward a position per distance, 1/s."""
Control = Callable[[View, Array], Array]
"""Function of a view and of numbers (B, n) that returns velocities (B, 2), m/s."""


def stroke(view: View, numbers: Array) -> Array:
    """Return the velocities of the controller "stroke", m/s, (B, 2)."""
    state, seat = view.state, view.seat
    own, puck = state.position[:, seat], state.puck[:, 0]
    moving = state.puck_velocity[:, 0]
    place, near, hit = numbers[:, :2], numbers[:, 2], numbers[:, 3:5]
    linear = numbers[:, 5:].reshape(-1, 2, 4)
    seen = np.concatenate([puck, moving], axis=1)
    aim = place + (linear @ seen[..., None])[..., 0]
    close = np.linalg.norm(puck - own, axis=1) < near
    return np.asarray(np.where(close[:, None], hit, GAIN * (aim - own)))


def circle(view: View, numbers: Array) -> Array:
    """Return the velocities of the controller "circle", m/s, (B, 2)."""
    state, goal = view.state, view.scenario_memory["goal"]
    radius, first, rise, pull = numbers.T
    away = state.position[:, view.seat] - goal
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-6)[:, None]
    out = away / distance
    around = np.stack([-out[:, 1], out[:, 0]], 1)
    speed = (first + rise * state.time)[:, None]
    return np.asarray(
        speed * around - pull[:, None] * (distance - radius[:, None]) * out
    )


def through(view: View, numbers: Array) -> Array:
    """Return the velocities of the controller "through", m/s, (B, 2)."""
    state, goal = view.state, view.scenario_memory["goal"]
    speed = np.abs(numbers[:, 0])
    # The start is unknown, so the direction is constant once the paddle is fast enough.
    gap, moving = goal - state.position[:, view.seat], state.velocity[:, view.seat]
    underway = np.linalg.norm(moving, axis=1) > 0.5 * speed
    direction = np.where(underway[:, None], moving, gap)
    size = np.maximum(np.linalg.norm(direction, axis=1), 1e-6)
    return np.asarray((speed / size)[:, None] * direction)


class Kind(NamedTuple):
    """Kind of controller, and the distribution in which its search begins."""

    control: Control
    mean: Array
    spread: Array


STROKE = Kind(
    stroke,
    np.array([-0.65, 0.0, 0.15, 0.5, 0.0, 0, 0, 0, 0, 0, 0.9, 0, 0.1]),
    np.array([0.1, 0.1, 0.06, 0.3, 0.3, *[0.15] * 8]),
)
KINDS = {
    "hit_goal": STROKE,
    "hit_goal_velocity": STROKE,
    "move_block": STROKE,
    "reach_velocity": Kind(
        circle, np.array([0.03, 0.2, 0.08, 4.0]), np.array([0.02, 0.1, 0.05, 3.0])
    ),
    "reach": Kind(through, np.array([0.4]), np.array([0.2])),
}


class Blind(Driver):
    """Controller with separate numbers in each world.

    Args:
        control: Function of the kind of controller.
        numbers: Numbers of the controllers, (B, n).
        options: Options of the scenario.
    """

    def __init__(
        self, control: Control, numbers: Array, options: dict[str, Any]
    ) -> None:
        self.control, self.numbers, self.options = control, numbers, options

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the velocities, divided by the top speed."""
        velocity = self.control(view, self.numbers)
        size = np.linalg.norm(velocity, axis=1)
        fit = np.maximum(size, view.top_speed)[:, None]
        return velocity / fit, memory


def play(driver: Blind, task: str, profile: str, seed: int) -> EpisodeStatistics:
    """Return the statistics of one episode for each row of numbers."""
    count = len(driver.numbers)
    world = build_driven_world(
        driver, task, count, {"profile": profile, "options": driver.options}
    )
    played = play_episodes(world, count, seed, COLUMNS)
    found = EpisodeStatistics(played, world.control_dt)
    world.close()
    return found


def search(task: str, kind: Kind, options: dict[str, Any]) -> Array:
    """Return the numbers with the highest success in the profile `ideal`."""
    found = [climb(task, kind, options, seed) for seed in range(RESTARTS)]
    scores = []
    for numbers in found:
        driver = Blind(kind.control, np.tile(numbers, (CHECKED, 1)), options)
        scores.append(play(driver, task, "ideal", CHECK_SEED).success.mean())
    return found[int(np.argmax(scores))]


def climb(task: str, kind: Kind, options: dict[str, Any], seed: int) -> Array:
    """Return the numbers that one search finds."""
    rng = np.random.default_rng(seed)
    mean, spread = kind.mean.copy(), kind.spread.copy()
    for generation in range(GENERATIONS):
        candidates = mean + spread * rng.standard_normal((CANDIDATES, len(mean)))
        driver = Blind(kind.control, np.repeat(candidates, PLAYED, axis=0), options)
        found = play(driver, task, "ideal", 1000 * (generation + 1))
        score = found.success + 0.01 * found.returns
        order = np.argsort(-score.reshape(CANDIDATES, PLAYED).mean(1))
        best = candidates[order[:ELITE]]
        mean, spread = best.mean(0), best.std(0) + 0.02 * kind.spread
    return mean


def rows_of(
    task: str, options: dict[str, Any], episodes: int
) -> list[dict[str, object]]:
    """Return the rows of a task, in both profiles."""
    kind = KINDS[task]
    numbers = search(task, kind, options)
    rows: list[dict[str, object]] = []
    for profile in ("ideal", "ur5e"):
        driver = Blind(kind.control, np.tile(numbers, (episodes, 1)), options)
        found = play(driver, task, profile, TEST_SEED)
        success = float(found.success.mean())
        low, high = interval(success, episodes)
        rows.append(
            {
                "task": task,
                "kind": kind.control.__name__,
                "profile": profile,
                "episodes": episodes,
                "success": f"{success:.3f}",
                "low": f"{low:.3f}",
                "high": f"{high:.3f}",
                "first_shot": f"{found.first_shot.mean():.3f}",
                "numbers": " ".join(f"{x:.4g}" for x in numbers),
            }
        )
        print(*[*rows[-1].values()][:-1], options or "", flush=True)
    return rows


def main(
    tasks: Annotated[
        str, typer.Option(help="Names of tasks, separated by commas.")
    ] = ",".join(KINDS),
    option: Annotated[
        list[str] | None,
        typer.Option(help="Option of the scenarios, NAME=VALUE; repeatable."),
    ] = None,
    episodes: Annotated[
        int, typer.Option(help="Number of episodes of a result.")
    ] = 1000,
    out: Annotated[Path | None, typer.Option(help="CSV file of the rows.")] = None,
) -> None:
    """Search and print a row for each task and profile."""
    rows = [
        row
        for task in tasks.split(",")
        for row in rows_of(task, settings(option), episodes)
    ]
    if out:
        with out.open("w", newline="") as file:
            table = csv.DictWriter(file, [*rows[0]])
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    typer.run(main)
