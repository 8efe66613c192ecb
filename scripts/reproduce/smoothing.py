"""Compare filters of commands: their cost for a policy and their effect on the arm.

    python scripts/reproduce/smoothing.py

A trained policy plays its task, and its paddle is the tool of an emulated arm. Its
actions pass through a filter (`hardware/robot/filters.py`), the robot client and the
emulated controller, in emulated time. The script measures the success, the acceleration
and the jerk of the true tool over 10 ms, and the number of protective stops of the arm.
A stop fails the episode. ``chatter`` is the same policy with each component of its
actions rounded to -1 or 1 (bang-bang actions), a bad example on purpose. The limits
"none" leave only the filters. "authors" are the constants of the authors' robot code.

A finished cell adds a row to the CSV file. A cell that has a row is not played again.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np
import typer
from rows import DATA, Again, Book, Row, RowsFile

from marl_airhockey.build import build_driven_world
from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.robot import PRESETS, DriverState, Preset, Smoothing
from marl_airhockey.policies.load import load_policy
from marl_airhockey.rollouts import play as episodes_of
from marl_airhockey.sim.contracts.driver import Driver, PrescribedMotion, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.types import Array

POLICIES = {"juggle": "zoo/juggle_ur5e", "hit_goal": "zoo/hit_goal_ur5e"}
FILTERS = (
    Smoothing("none", 0.0),
    Smoothing("low_pass", 0.05),
    Smoothing("jerk_limited", 0.05),
    Smoothing("minimum_jerk", 0.0),
    Smoothing("minimum_jerk", 0.05),
)
AUTHORS = PRESETS["authors"]
LIMITS = {
    "ur5e": PRESETS["ur5e"],
    "none": replace(AUTHORS, servo=replace(PRESETS["ur5e"].servo, deviation=5.0)),
    "authors": AUTHORS,
}
CELLS = (
    *itertools.product(POLICIES, ("policy", "bang-bang"), ("ur5e", "none"), FILTERS),
    *itertools.product(POLICIES, ("policy", "bang-bang"), ("authors",), FILTERS[:1]),
)
SAMPLE = 0.01
"""Time over which the movement is measured, s."""
SETUP = LabSetup(table="standard")
COLUMNS = (
    *("task", "commands", "limits", "filter", "time_s", "episodes", "success", "low"),
    *("high", "acceleration_peak", "jerk_peak", "jerk_rms", "stops_per_hour"),
)


class EmulatedPlayer(Driver):
    """Policy whose paddle is the tool of an emulated arm, in emulated time.

    Args:
        policy: Policy to play with.
        chatters: True to round each component of its actions to -1 or 1.
        preset: Limits and settings of the robot client.
        smoothing: Filter of the commands.
    """

    needs_device = True
    commands_device = True

    def __init__(
        self, policy: Driver, chatters: bool, preset: Preset, smoothing: Smoothing
    ) -> None:
        self._policy, self._chatters = policy, chatters
        self._preset, self._smoothing = preset, smoothing
        self.observe = policy.observe
        self.velocities: list[Array] = []
        """Velocities of the tool in each episode, every `SAMPLE`, m/s, (N, 2)."""
        self.stops = 0
        """Number of protective stops."""
        self.robot = self._start()

    def _start(self) -> EmulatedRobot:
        robot = EmulatedRobot(self._preset, self._smoothing, SETUP)
        robot.enable()
        for _ in range(24):
            robot.send_action(np.zeros(2))
            robot.advance(0.05)
        return robot

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Begin an episode with the paddle at its home position."""
        if self.stopped or not self.robot.drive_to(self.robot.setup.home):
            self.robot = self._start()
        self._moved = [self.robot.true_velocity]
        return self._policy.reset(seat, rng, worlds)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Send an action to the arm and advance by a control step."""
        action, memory = self._policy.act(view, memory)
        if self._chatters:
            action = np.where(action < 0.0, -1.0, 1.0)
        self.robot.send_action(action[0] * view.top_speed[0], view.control_dt)
        for _ in range(round(view.control_dt / SAMPLE)):
            self.robot.advance(SAMPLE)
            self._moved.append(self.robot.true_velocity)
        return action, memory

    def measured(self) -> PrescribedMotion:
        """Return position, m, and velocity, m/s, that the arm reports, (1, 4)."""
        now = self.robot.get_observation()
        return np.array([[now.x, now.y, now.vx, now.vy]])

    @property
    def stopped(self) -> bool:
        """True after a stop of the arm."""
        return self.robot.state in (DriverState.HOLD, DriverState.FAULT)

    def end(self) -> None:
        """Save the measurements of an episode."""
        self.velocities.append(np.array(self._moved))
        self.stops += self.stopped


def play(task: str, player: EmulatedPlayer, episodes: int) -> int:
    """Return the number of successes; an episode with a stop is a failure."""
    world = build_driven_world(player, task, 1, {"profile": "ur5e"})
    successes = 0
    for episode in range(episodes):
        world.reset(TEST_SEED + episode)
        ended = False
        for step in episodes_of.play(world):
            ended = bool(step.ended[0])
            if player.stopped:
                break
        successes += bool(ended and world.episode.success[0, 0])
        player.end()
    world.close()
    return successes


def measure(
    task: str, commands: str, limits: str, smoothing: Smoothing, episodes: int
) -> dict[str, str | int]:
    """Return the row of a cell."""
    policy = load_policy(POLICIES[task])
    chatters = commands == "bang-bang"
    player = EmulatedPlayer(policy, chatters, LIMITS[limits], smoothing)
    successes = play(task, player, episodes)
    low, high = interval(successes / episodes, episodes)
    accelerations = [np.diff(v, axis=0) / SAMPLE for v in player.velocities]
    jerks = [np.diff(a, axis=0) / SAMPLE for a in accelerations]
    sizes = np.concatenate([np.linalg.norm(j, axis=1) for j in jerks])
    hours = sum(map(len, player.velocities)) * SAMPLE / 3600.0
    largest = max(np.linalg.norm(a, axis=1).max() for a in accelerations)
    return {
        "episodes": episodes,
        "success": f"{successes / episodes:.3f}",
        "low": f"{low:.3f}",
        "high": f"{high:.3f}",
        "acceleration_peak": f"{largest:.1f}",
        "jerk_peak": f"{sizes.max():.0f}",
        "jerk_rms": f"{np.sqrt((sizes**2).mean()):.0f}",
        "stops_per_hour": f"{player.stops / hours:.0f}",
    }


BY_CELL = {
    (task, commands, limits, smoothing.name, f"{smoothing.time:g}"): smoothing
    for task, commands, limits, smoothing in CELLS
}
"""Filter of each cell, by the values of the first columns."""
BOOK = Book(DATA / "smoothing.csv", COLUMNS[:5])


def row_of(
    episodes: int, task: str, commands: str, limits: str, name: str, time: str
) -> Row:
    """Return the row of the cell with these values of the first columns."""
    cell = task, commands, limits, name, time
    found = measure(task, commands, limits, BY_CELL[cell], episodes)
    return dict(zip(COLUMNS[:5], cell, strict=True)) | found


def main(
    episodes: Annotated[
        int, typer.Option(help="Number of episodes of each cell.")
    ] = 50,
    jobs: Annotated[int, typer.Option(help="Number of cells at a time.")] = 2,
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Play the cells that have no row."""
    book = BOOK.at(rows)
    book.fill(book.missing([*BY_CELL], again), partial(row_of, episodes), jobs)


if __name__ == "__main__":
    typer.run(main)
