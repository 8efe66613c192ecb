"""Measure in real time how an arm comes to rest, for faults and killed processes.

    python scripts/bench/stops.py --out docs/data/stops.json

A caller commands 0.5 m/s 20 times per second. Caller, robot client (with the real
client) and the lab's controller are separate processes. Then a fault is switched on, or
one of the processes is killed. The lab reports the true state of its paddle. The script
prints medians and worst values over the trials:

* time until the robot client begins to brake, where it is the one that brakes,
* time until the paddle is slower by a tenth,
* time until the paddle is at rest (0.01 m/s),
* largest deceleration, over 10 ms.

For a new command, and for commands that stop, times count from the command.
`stops_emulated.py` measures the same in emulated time, also for pairs of faults.

The script takes about 35 minutes. Nothing else should run at the same time. Finished
cases are in the file. A case that is there with the same number of trials is not
measured again.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import numpy as np

from marl_airhockey.hardware.lab.lab import Lab
from marl_airhockey.hardware.robot import DriverState, Robot, RobotConfig
from marl_airhockey.types import Array

SPEED = 0.5
"""Commanded speed, m/s."""
CONTROL_DT = 0.05
"""Time between two commands, s."""
LISTEN = 3.0
"""Longest time for which the paddle is observed, s."""
STILL = 0.01
"""Speed below which the paddle is at rest, m/s."""
ANSWER = 40.0
"""Longest time until a caller has its paddle in motion, s."""
UP = np.array([0.0, SPEED])
FAULTS = (
    *("protective_stop", "emergency_stop", "silent_robot", "delayed_packets"),
    *("dropped_connection", "loss_of_real_time", "puck_under_paddle"),
    *("speed_slider", "power_off"),
)
MEASURES = ("driver_brakes_s", "slower_s", "rest_s", "deceleration_m_s2")


class Report(NamedTuple):
    """Report of a caller."""

    commanded_at: float
    """Time of the first changed command, or of the last command, s."""
    braked_at: float
    """Time at which the robot client began to brake by its own decision, s."""


def run_caller(config: RobotConfig, start: Array, pipe: Connection) -> None:
    """Command a velocity until the pipe sends another one; None ends the commands."""
    with Robot(config) as robot:
        while robot.state is DriverState.FAULT:
            time.sleep(5.5)
            robot.recover()
        robot.go_to(start)
        command: Array | None = UP
        begun = time.monotonic()
        changed_at = told = 0.0
        while True:
            if command is not None:
                robot.send_action(command, CONTROL_DT)
                changed_at = changed_at or robot.commanded_at * (command is not UP)
            if not told and time.monotonic() > begun + 0.35:
                pipe.send(robot.pid)
                told = True
            if not pipe.poll(CONTROL_DT):
                continue
            order = pipe.recv()
            if isinstance(order, str):
                now = robot.get_observation()
                pipe.send(Report(changed_at or robot.commanded_at, now.braked_at))
                return
            command = order


class NotMovingError(RuntimeError):
    """Error of a trial that did not begin."""


class Trial:
    """Trial: a moving paddle, and the processes that move it.

    Args:
        lab: Lab with the arm.
    """

    def __init__(self, lab: Lab) -> None:
        self.lab, setup = lab, lab.setup
        config = RobotConfig(lab.host, setup.mounting, setup.seat.reach)
        context = multiprocessing.get_context("spawn")
        self._pipe, end = context.Pipe()
        start = setup.home - (0.0, 0.2)
        self.caller = context.Process(target=run_caller, args=(config, start, end))
        self.caller.start()
        end.close()
        self.driver_pid = self._wait()

    def _wait(self) -> int:
        """Return the process id of the robot client when the paddle moves.

        Raises:
            NotMovingError: The paddle does not move, for example because the machine is
                busy.
        """
        try:
            if self._pipe.poll(ANSWER):
                return int(self._pipe.recv())
        except EOFError:
            pass
        self.caller.kill()
        self.caller.join()
        raise NotMovingError("the caller's paddle does not move")

    def command(self, velocity: Array | None) -> None:
        """Let the caller command another velocity (2,), m/s; None ends the commands."""
        self._pipe.send(velocity)

    def end(self) -> Report:
        """End the caller and return its report; nan if the caller is dead."""
        try:
            self._pipe.send("end")
            report = Report(*self._pipe.recv())
        except (OSError, EOFError):
            report = Report(np.nan, np.nan)
        self.caller.join()
        return report


def listen(lab: Lab) -> Array:
    """Return rows of time, x, y, vx, vy of the true paddle until it is at rest.

    The rows include at least the first 0.3 s, because it may begin to brake late.
    """
    rows, begin = [], time.monotonic()
    while time.monotonic() < begin + LISTEN:
        truth = lab.ask({"do": "truth"})
        rows.append([truth["time"], *np.array(truth["paddle"])[[0, 1, 3, 4]]])
        if np.hypot(*rows[-1][3:]) < STILL and time.monotonic() > begin + 0.3:
            break
        time.sleep(0.002)
    return np.array(rows)


def judge(rows: Array, since: float, braked_at: float) -> tuple[float, ...]:
    """Return the `MEASURES`; nan for missing values."""
    speed, t = np.linalg.norm(rows[:, 3:], axis=1), rows[:, 0]
    brakes = t[(t > since) & (speed < 0.9 * SPEED)]
    rests = t[(t > since) & (speed < STILL)]
    asked = braked_at - since if braked_at > since else np.nan
    if not len(brakes) or not len(rests):
        return asked, np.nan, np.nan, np.nan
    # Over 10 ms, because the lab reports what its controller published last.
    fine = np.arange(since, rests[0] + 0.01, 0.01)
    slowing = -np.diff(np.interp(fine, t, speed)) / 0.01
    return asked, brakes[0] - since, rests[0] - since, float(slowing.max())


class Bench:
    """Bench of trials; its lab is opened again after its controller was killed."""

    def __init__(self) -> None:
        self.lab = Lab()

    def fault(self, name: str) -> Callable[[Trial], None]:
        """Return a function that switches a fault on."""
        return lambda trial: self._switch(name, True)

    def _switch(self, name: str, on: bool) -> None:
        self.lab.ask({"do": "fault", "name": name, "on": on})

    def kill_controller(self, trial: Trial) -> None:
        """Kill the process of the lab's arm."""
        os.kill(self.lab.ask({"do": "info"})["pids"][0], signal.SIGKILL)

    def clear(self) -> None:
        """Switch all faults off."""
        if all(self.lab.alive):
            for name in FAULTS:
                self._switch(name, False)
            return
        self.lab.close()
        self.lab = Lab()

    def _begin(self) -> Trial:
        """Return a trial, with a second attempt if it does not begin."""
        try:
            return Trial(self.lab)
        except NotMovingError as error:
            print(f"{error}; trying again", flush=True)
            return Trial(self.lab)

    def measure(
        self, act: Callable[[Trial], None], of_command: bool
    ) -> tuple[float, ...]:
        """Return the `MEASURES` of one trial.

        Args:
            act: Function that causes the fault.
            of_command: True to count times from the command.
        """
        trial = self._begin()
        since = time.monotonic()
        act(trial)
        rows = listen(self.lab)
        report = trial.end()
        self.clear()
        begin = report.commanded_at if of_command else since
        return judge(rows, begin, report.braked_at)


def kill_caller(trial: Trial) -> None:
    """Kill the caller."""
    trial.caller.kill()


def kill_driver(trial: Trial) -> None:
    """Kill the robot client."""
    os.kill(trial.driver_pid, signal.SIGKILL)


def summarize(case: str, values: Array) -> dict[str, object]:
    """Return the row of a case: medians and worst values, None if there are none."""

    def number(x: float) -> float | None:
        return None if np.isnan(x) else round(float(x), 4)

    row: dict[str, object] = {"case": case, "trials": len(values)}
    for name, column in zip(MEASURES, values.T, strict=True):
        known = column[~np.isnan(column)]
        median, worst = (np.median(known), known.max()) if len(known) else (np.nan,) * 2
        row[name] = {"median": number(median), "worst": number(worst)}
    return row


def show(row: dict[str, object]) -> None:
    """Print a row of the table."""
    cells = []
    for name in MEASURES:
        pair = row[name]
        assert isinstance(pair, dict)
        scale, form = (1.0, "{:.1f}") if name.endswith("s2") else (1e3, "{:.0f}")
        known = [x for x in pair.values() if x is not None]
        cells.append(" / ".join(form.format(scale * x) for x in known))
    print(f"| {row['case']} | " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--out", type=Path, help="JSON file of the rows.")
    given = parser.parse_args()
    bench = Bench()
    cases: dict[str, tuple[Callable[[Trial], None], bool]] = {
        "a command to rest": (lambda trial: trial.command(np.zeros(2)), True),
        "commands stop": (lambda trial: trial.command(None), True),
        "the caller is killed": (kill_caller, False),
        "the driver is killed": (kill_driver, False),
        "the controller is killed": (bench.kill_controller, False),
        **{name: (bench.fault(name), False) for name in FAULTS},
    }
    columns = "driver brakes, ms", "a tenth slower, ms", "at rest, ms", "m/s2"
    print(f"| | {' | '.join(columns)} |")
    print("| --- | --- | --- | --- | --- |")
    known = given.out.exists() if given.out else False
    old = json.loads(given.out.read_text()) if known else []
    rows = [row for row in old if row["trials"] == given.trials]
    try:
        for name, case in cases.items():
            if not any(row["case"] == name for row in rows):
                values = [bench.measure(*case) for _ in range(given.trials)]
                rows.append(summarize(name, np.array(values)))
                if given.out:
                    given.out.write_text(json.dumps(rows, indent=1) + "\n")
            show(next(row for row in rows if row["case"] == name))
    finally:
        bench.lab.close()


if __name__ == "__main__":
    main()
