"""Drive an emulated arm for hours, with random commands, slider moves and faults.

    python scripts/bench/soak.py --hours 6 --out docs/data/soak.json

The robot client runs at its rate of 125 Hz in emulated time. These events are emulated:

* A caller commands random velocities 20 times per second, some of them extreme.
* A person moves the speed slider.
* About every 20 s a fault of the controller begins, and ends after a few seconds.
* The process of the robot client stalls now and then.
* An operator recovers from each FAULT and guides an arm back that was carried away.

The script prints the state changes of the robot client, the largest speed of the paddle
while the client's URScript moves it, and the number of leaps. A leap is a moment with a
speed above 1.02 times the limit; there must be none.

Six hours take about 25 minutes of one core.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from collections import Counter
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import numpy as np

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.robot import DriverState, Fault
from marl_airhockey.hardware.ur_emulator.arm import DT
from marl_airhockey.hardware.ur_emulator.faults import FAULTS
from marl_airhockey.hardware.ur_emulator.motions import Line
from marl_airhockey.sim.core.geometry import half_planes

CONTROL_DT = 0.05
OF_CONNECTIONS = ("forgotten_recipes", "late_state")
"""Faults that only occur over a network."""
NAMES = [name for name in FAULTS if name not in OF_CONNECTIONS]
LEAP = 1.02
"""Speed above which a moment is a leap, divided by the limit."""
OPERATOR = 6.0
"""Time after which an operator recovers from a FAULT, s."""
MOST_AWAY = 0.3
"""Distance from home from which an arm is guided back, m."""
AT_TABLE = 0.04
"""Distance from the workspace up to which the robot client accepts the arm, m."""


class Soak:
    """Long run of one robot.

    Args:
        seed: Seed of everything that is random.
    """

    def __init__(self, seed: int) -> None:
        self.rng, self.robot = np.random.default_rng(seed), EmulatedRobot()
        self.limit = self.robot.config.limits.speed
        self.normals, self.offsets = half_planes(self.robot.setup.seat.reach)
        self.top, self.outside, self.depth, self.longest = 0.0, -np.inf, 0.0, 0.0
        self.leaps = self.cycles = self.faults = 0
        self._left_at = 0.0
        self.changes: Counter[str] = Counter()
        self._state = (self.robot.state, self.robot.fault)
        self._fault, self._until, self._next = "", 0.0, 5.0
        self._slider_at, self._stalled_until, self._faulty_since = 8.0, 0.0, -1.0
        self._watch_cycles()
        self.robot.enable()

    def _watch_cycles(self) -> None:
        """Measure the CPU time of each cycle of the current robot client."""
        driver = self.robot.driver
        cycle = driver.cycle

        def timed() -> None:
            began, now = time.thread_time(), self.robot.now
            cycle()
            # A call that waits for the controller emulates it and is not counted.
            if self.robot.now == now:
                self.longest = max(self.longest, time.thread_time() - began)
            self.cycles += 1

        driver.cycle = timed  # type: ignore[method-assign]

    def run(self, seconds: float) -> None:
        """Run for some seconds of emulated time."""
        end = self.robot.now + seconds
        velocity = np.zeros(2)
        while self.robot.now < end:
            self._disturb()
            if self.rng.random() < 0.15:
                velocity = self.rng.normal(0.0, 0.5, 2)
            if self.rng.random() < 0.02:
                velocity = self.rng.choice([np.nan, np.inf, 1e308, -50.0, 50.0], 2)
            if self.rng.random() > 0.01:
                self.robot.send_action(velocity, CONTROL_DT)
            for _ in range(round(CONTROL_DT / DT)):
                self.robot.advance(DT)
                self._measure()
            self._operate()

    def _disturb(self) -> None:
        """Switch faults, move the slider and stall the robot client."""
        robot, rng, now = self.robot, self.rng, self.robot.now
        if self._fault and now > self._until:
            robot.switch(self._fault, False)
            self._fault, self._next = "", now + rng.exponential(15.0)
        elif not self._fault and now > self._next:
            self._fault = str(rng.choice(NAMES))
            self._until = now + rng.uniform(0.2, 6.0)
            self.faults += 1
            robot.switch(self._fault)
        if now > self._slider_at and "slider" not in self._fault:
            robot.controller.arm.speed_fraction = float(
                rng.choice([0.1, 0.5, 1.0, 1.0])
            )
            self._slider_at = now + rng.exponential(8.0)
        if rng.random() < 0.005:
            self._stalled_until = now + rng.uniform(0.02, 0.25)
        robot.driver_runs = now >= self._stalled_until

    def _measure(self) -> None:
        robot = self.robot
        if (robot.state, robot.fault) != self._state:
            self._state = (robot.state, robot.fault)
            self.changes[f"{robot.state.name}: {robot.fault.label}"] += 1
        if not robot.controller.script.running:
            return
        speed = float(np.linalg.norm(robot.true_velocity))
        self.top = max(self.top, speed)
        self.leaps += speed > LEAP * self.limit
        place = robot.true_position
        if robot.state is not DriverState.FAULT:
            # A person may leave the arm outside. Then only its return is checked.
            outside = max(self._outside(), 0.0)
            self._left_at = min(self._left_at, outside)
            self.outside = max(self.outside, outside - self._left_at)
            self.depth = max(self.depth, -float(place[2]))

    def _outside(self) -> float:
        """Return the distance of the paddle outside of its workspace, m."""
        place = self.robot.true_position[:2]
        return -float((self.normals @ place + self.offsets).min())

    def _operate(self) -> None:
        """Act as an operator: end HOLDs that persist, and recover from FAULTs."""
        robot, now = self.robot, self.robot.now
        if robot.state is DriverState.HOLD and self.rng.random() < 0.05:
            robot.disable()
            robot.advance(0.1)
            robot.enable()
        if robot.state is not DriverState.FAULT:
            self._faulty_since = -1.0
            return
        if self._faulty_since < 0.0:
            self._faulty_since = now
        if self._fault or now - self._faulty_since < OPERATOR:
            return
        self._guide_back()
        if robot.fault is Fault.EMERGENCY_STOP or robot.driver.is_over:
            robot.start_driver()
            self._watch_cycles()
        else:
            robot.recover()
            robot.advance(0.5)
        self._left_at = max(self._outside(), 0.0)
        robot.enable()

    def _guide_back(self) -> None:
        """Guide an arm home that was carried away, as a person does."""
        robot, home = self.robot, np.asarray(self.robot.setup.home)
        arm = robot.controller.arm
        away = np.linalg.norm(robot.true_position[:2] - home) > MOST_AWAY
        if away or self._outside() > AT_TABLE or robot.fault is Fault.NOT_AT_TABLE:
            arm.motion = Line(robot.setup.mounting.pose(home, 0.01), 0.25, 1.0)
            robot.advance(5.0)

    def row(self, hours: float) -> dict[str, object]:
        """Return the measured values."""
        return {
            "hours": hours,
            "cycles": self.cycles,
            "faults": self.faults,
            "longest_cycle_cpu_ms": round(1e3 * self.longest, 2),
            "top_speed": round(self.top, 4),
            "limit": self.limit,
            "leaps": int(self.leaps),
            "outside_mm": round(1e3 * max(self.outside, 0.0), 2),
            "below_table_mm": round(1e3 * self.depth, 2),
            "changes": dict(self.changes.most_common()),
        }


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--hours", type=float, default=6.0, help="Number of emulated hours."
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="JSON file of the result.")
    given = parser.parse_args()
    logging.getLogger("marl_airhockey.robot").setLevel(logging.ERROR)
    soak = Soak(given.seed)
    slices = max(round(6 * given.hours), 1)
    for k in range(slices):
        with redirect_stderr(StringIO()):
            soak.run(3600.0 * given.hours / slices)
        passed = given.hours * (k + 1) / slices
        print(f"{passed:.2f} h: {soak.row(passed)}", flush=True)
    if given.out:
        given.out.write_text(json.dumps(soak.row(given.hours), indent=1) + "\n")


if __name__ == "__main__":
    main()
