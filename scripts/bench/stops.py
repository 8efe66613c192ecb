"""Measure how the arm of the virtual lab comes to rest, for each fault.

    python scripts/bench/stops.py

The paddle moves at 0.5 m/s when a fault is switched on, or a process is killed. The
lab tells the truth of its paddle. Printed are the longest times from then until the
driver begins to brake (where it is the one that does), until the true paddle is slower
by a tenth, and until it rests (0.01 m/s), and the largest deceleration in between, over
some tries. Commands that fail to come count from the last one. ``--smoothing`` is that
of a rig: it is in what a policy commands, and in no stop of the driver's own.
"""

from __future__ import annotations

import argparse
import os
import signal
import threading
import time
from collections.abc import Callable

import numpy as np

from marl_airhockey.devices.robot import DriverConfig, Robot, Smoothing
from marl_airhockey.lab.lab import Lab
from marl_airhockey.types import Array

SPEED = 0.5
"""m/s"""
LISTEN = 1.0
"""Time for which the truth is listened to, s"""
UP = np.array([0.0, SPEED])
REST = np.zeros(2)
Case = tuple[Callable[[Robot], None], Callable[[], None], Array | None]
"""What lets something go wrong, what lets it be right again, and the velocity that is
commanded meanwhile; None for no commands"""


def drive(robot: Robot, seconds: float) -> None:
    """Command a velocity for a while, 20 times a second."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        robot.send_action(UP, 0.05)
        time.sleep(0.05)


def listen(lab: Lab, seconds: float) -> Array:
    """Return rows of time, x, y, vx, vy of the paddle, as it truly is."""
    rows, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        truth = lab.ask({"do": "truth"})
        rows.append([truth["time"], *np.array(truth["paddle"])[[0, 1, 3, 4]]])
        time.sleep(0.002)
    return np.array(rows)


def judge(rows: Array, since: float, braked_at: float) -> tuple[float, ...]:
    """Return the times of braking and rest, s after a moment, and the deceleration."""
    speed, t = np.linalg.norm(rows[:, 3:], axis=1), rows[:, 0]
    brakes = t[(t > since) & (speed < 0.9 * SPEED)]
    rests = t[(t > since) & (speed < 0.01)]
    # Over 10 ms: the lab tells what its controller has published last.
    fine = np.arange(since, since + LISTEN, 0.01)
    slowing = -np.diff(np.interp(fine, t, speed)) / 0.01
    if not len(brakes) or not len(rests):
        return (np.nan,) * 4
    asked = braked_at - since if braked_at > since else np.nan
    return asked, brakes[0] - since, rests[0] - since, float(slowing.max())


def measure(
    lab: Lab,
    smoothing: float,
    act: Callable[[Robot], None],
    undo: Callable[[], None],
    wanted: Array | None,
) -> tuple[float, ...]:
    """Return what `judge` says of one try.

    Args:
        lab: that runs.
        smoothing: of commands, s.
        act: lets something go wrong.
        undo: lets it be right again.
        wanted: velocity that is commanded meanwhile, m/s; None for no commands.
    """
    setup = lab.setup
    config = DriverConfig(
        *(lab.host, setup.mounting, setup.seat.reach),
        smoothing=Smoothing("low_pass", smoothing),
    )
    with Robot(config) as robot:
        while robot.state.name == "FAULT":
            time.sleep(5.5)
            robot.recover()
        robot.go_to(setup.home - (0.0, 0.2))
        drive(robot, 0.35)
        since = robot.commanded_at if wanted is None else time.monotonic()
        act(robot)
        going = threading.Event()

        def go_on() -> None:
            while wanted is not None and not going.wait(0.05):
                robot.send_action(wanted, 0.05)

        thread = threading.Thread(target=go_on)
        thread.start()
        rows = listen(lab, LISTEN)
        going.set()
        thread.join()
        undo()
        return judge(rows, since, robot.get_observation().braked_at)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--tries", type=int, default=5)
    parser.add_argument("--smoothing", type=float, default=0.0, help="s")
    given = parser.parse_args()
    tries = given.tries
    with Lab() as lab:

        def fault(name: str) -> Case:
            order = {"do": "fault", "name": name}

            def act(robot: Robot) -> None:
                lab.ask({**order, "on": True})

            def undo() -> None:
                lab.ask({**order, "on": False})

            return act, undo, UP

        def kill(robot: Robot) -> None:
            assert robot.pid is not None
            os.kill(robot.pid, signal.SIGKILL)

        cases: dict[str, Case] = {
            "a command to rest": (
                *(lambda robot: robot.send_action(REST, 0.05), lambda: None),
                REST,
            ),
            "commands fail to come": (lambda robot: None, lambda: None, None),
            "the driver is killed": (kill, lambda: None, UP),
            **{
                name.replace("_", " "): fault(name)
                for name in (
                    *("protective_stop", "emergency_stop", "silent_robot"),
                    *("delayed_packets", "puck_under_paddle"),
                )
            },
        }
        print(
            f"{'longest of ' + str(tries):24} driver   slower   at rest   deceleration"
        )
        for name, case in cases.items():
            rows = np.array(
                [measure(lab, given.smoothing, *case) for _ in range(tries)]
            )
            asked, slower, rests = (f"{1e3 * x:.0f} ms" for x in most(rows[:, :3]))
            slowing = f"{most(rows)[3]:.1f} m/s2"
            print(f"{name:24} {asked:>6} {slower:>8} {rests:>9} {slowing:>14}")


def most(rows: Array) -> Array:
    """Return the largest number in each column; nan where there is none."""
    filled = np.where(np.isnan(rows), -np.inf, rows).max(0)
    return np.where(np.isinf(filled), np.nan, filled)


if __name__ == "__main__":
    main()
