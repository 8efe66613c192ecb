"""Measure how an arm comes to rest for every fault, and for every pair of faults.

    python scripts/bench/stops_emulated.py --out docs/data/stops_emulated.json

The robot client moves the emulated arm at 0.3 to 0.7 m/s in emulated time. Then one or
two faults are switched on, the second one 0 to 200 ms after the first. The script
prints medians and worst values over the trials:

* time from the first fault until braking begins, when the robot client or the
  controller reduces the speed that is sent to the arm,
* time until the paddle is at rest (below 0.01 m/s),
* largest deceleration of a joint and of the tool, over 2 ms.

For commands that stop, times count from the last command. `stops.py` measures the same
with processes, the real client and a real clock.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.ur_emulator.arm import DT
from marl_airhockey.hardware.ur_emulator.motions import Halt
from marl_airhockey.types import Array

CONTROL_DT = 0.05
LISTEN = 4.0
"""Time for which the arm is observed after a fault, s."""
CONTROLLER = (
    *("protective_stop", "emergency_stop", "silent_robot", "delayed_packets"),
    *("dropped_connection", "loss_of_real_time", "puck_under_paddle"),
    *("speed_slider", "power_off"),
)
"""Faults of the controller, without local control, which does not stop a running
URScript."""


class Caller:
    """Caller of the robot client: commands one velocity and causes faults."""

    def __init__(self, robot: EmulatedRobot, velocity: Array) -> None:
        self.robot, self.velocity = robot, velocity
        self.silent, self.sends_nan = False, False
        self._due = robot.now
        self.last = robot.now
        """Time of the last valid command, s."""

    def step(self) -> None:
        """Send a command if one is due."""
        if self.robot.now + 1e-9 < self._due:
            return
        self._due += CONTROL_DT
        if self.silent:
            return
        velocity = self.velocity
        if self.sends_nan:
            velocity = np.full(2, np.nan)
        else:
            self.last = self.robot.now
        self.robot.send_action(velocity, CONTROL_DT)

    def fall_silent(self) -> None:
        """Stop sending commands."""
        self.silent = True

    def send_nan(self) -> None:
        """Send nan from now on."""
        self.sends_nan = True

    def kill_driver(self) -> None:
        """End the process of the robot client."""
        self.robot.driver_runs = False


def faults_of(caller: Caller) -> dict[str, Callable[[], None]]:
    """Return functions that switch faults on, by name."""

    def of_controller(name: str) -> Callable[[], None]:
        return lambda: caller.robot.switch(name)

    return {
        **{name: of_controller(name) for name in CONTROLLER},
        "commands_stop": caller.fall_silent,
        "commands_are_nan": caller.send_nan,
        "driver_killed": caller.kill_driver,
    }


def speed_sent(robot: EmulatedRobot) -> float:
    """Return the speed that the robot client sends, m/s."""
    sent = robot.get_observation()
    return float(np.hypot(sent.sent_vx, sent.sent_vy))


def try_faults(names: tuple[str, ...], rng: np.random.Generator) -> tuple[float, ...]:
    """Return the times of braking and rest, s, and the largest decelerations."""
    robot = EmulatedRobot()
    sign = rng.choice([-1.0, 1.0])
    assert robot.drive_to(np.array(robot.setup.home) - (0.0, 0.25 * sign))
    caller = Caller(robot, np.array([0.0, sign * rng.uniform(0.3, 0.7)]))
    begin = robot.now + 0.35 + rng.uniform(0.0, CONTROL_DT)
    while robot.now < begin:
        caller.step()
        robot.advance(DT)
    switches = faults_of(caller)
    gaps = [0.0, *rng.uniform(0.0, 0.2, len(names) - 1)]
    pending = [
        (begin + gap, switches[name]) for gap, name in zip(gaps, names, strict=True)
    ]
    first = robot.now
    speed = float(np.linalg.norm(robot.true_velocity))
    sent_speed = speed_sent(robot)
    begins = rests = joints = tool = np.nan
    while robot.now < first + LISTEN and np.isnan(rests):
        while pending and robot.now >= pending[0][0]:
            pending.pop(0)[1]()
        caller.step()
        before = robot.controller.arm.speeds, np.linalg.norm(robot.true_velocity)
        began = robot.now
        robot.advance(DT)
        # More than DT passes if the robot client waits for the controller.
        passed = robot.now - began
        after = robot.controller.arm.speeds, np.linalg.norm(robot.true_velocity)
        slowing = float(np.max(np.abs(before[0]) - np.abs(after[0]))) / passed
        joints = np.fmax(joints, slowing)
        tool = np.fmax(tool, float(before[1] - after[1]) / passed)
        halts = isinstance(robot.controller.arm.motion, Halt)
        slows = speed_sent(robot) < 0.999 * sent_speed
        if np.isnan(begins) and (halts or slows or after[1] < 0.98 * speed):
            begins = robot.now
        if after[1] < 0.01:
            rests = robot.now
    since = caller.last if names == ("commands_stop",) else first
    return begins - since, rests - since, float(joints), float(tool)


def measure(names: tuple[str, ...], trials: int) -> dict[str, object]:
    """Return medians and worst values of some trials; None if there are none."""

    def number(x: float) -> float | None:
        return None if np.isnan(x) else round(float(x), 4)

    rng = np.random.default_rng([len(names), *(map(ord, "".join(names)))])
    rows = np.array([try_faults(names, rng) for _ in range(trials)])
    known = [column[~np.isnan(column)] for column in rows.T]
    median = [np.median(column) if len(column) else np.nan for column in known]
    worst = [column.max() if len(column) else np.nan for column in known]
    columns = ("begins_s", "rest_s", "joint_rad_s2", "tool_m_s2")
    return {
        "faults": " + ".join(names),
        "trials": trials,
        "come_to_rest": len(known[1]),
        **{
            name: {"median": number(m), "worst": number(w)}
            for name, m, w in zip(columns, median, worst, strict=True)
        },
    }


def show(row: dict[str, object]) -> None:
    """Print a row of the table."""
    cells = []
    for name, scale, form in (
        ("begins_s", 1e3, "{:.0f}"),
        ("rest_s", 1e3, "{:.0f}"),
        ("joint_rad_s2", 1.0, "{:.1f}"),
        ("tool_m_s2", 1.0, "{:.1f}"),
    ):
        pair = row[name]
        assert isinstance(pair, dict)
        values = [form.format(scale * x) for x in pair.values() if x is not None]
        cells.append(" / ".join(values))
    print(f"| {row['faults']} | " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--out", type=Path, help="JSON file of the rows.")
    given = parser.parse_args()
    robot = EmulatedRobot()
    names = [*faults_of(Caller(robot, np.zeros(2)))]
    print("| faults | braking begins, ms | at rest, ms | joint, rad/s2 | tool, m/s2 |")
    print("| --- | --- | --- | --- | --- |")
    rows = []
    for group in [(name,) for name in names] + [*itertools.combinations(names, 2)]:
        rows.append(measure(group, given.trials))
        show(rows[-1])
    if given.out:
        given.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
