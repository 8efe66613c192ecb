"""Measure how an arm tracks commands: a circle at 0.7 m/s, 20 commands per second.

    python scripts/bench/tracking.py --out docs/data/tracking.csv \
        --plot docs/images/tracking.png

The reference is the path of the commands: velocities that are reached by linear ramps
of 50 ms. The latency is the delay of the reference at which the true paddle is closest
to it. The tracking error is the remaining distance. In emulated time everything is in
one process. In real time the caller, the robot client (with the real client) and the
lab's controller are separate processes with all their delays.
"""

from __future__ import annotations

import csv
import time
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.lab.lab import Lab
from marl_airhockey.hardware.robot import FILTERS, Robot, RobotConfig, Smoothing
from marl_airhockey.sim.render.charts import SOFT, panels, save, series
from marl_airhockey.types import Array

SPEED, RADIUS = 0.7, 0.12
CONTROL_DT = 0.05
RAMP, SECONDS = 1.0, 8.0
"""Time in which the circle reaches its speed, and total time, s."""


class Record(NamedTuple):
    """Record of a movement."""

    commands: Array
    """Time, s, and velocity, m/s, of each command, (n, 3)."""
    paddle: Array
    """Time, s, and position, m, of the true paddle, (m, 3)."""


def velocity_at(t: float) -> Array:
    """Return the velocity of the command at a time, m/s, (2,)."""
    speed = SPEED * min(t / RAMP, 1.0)
    path = SPEED * (0.5 * t**2 / RAMP if t < RAMP else t - 0.5 * RAMP)
    angle = path / RADIUS
    return speed * np.array([-np.sin(angle), np.cos(angle)])


def start_in(reach: tuple[tuple[float, float], ...]) -> Array:
    """Return the position, m, at which the circle in the middle begins, (2,)."""
    x, y = 0.5 * (np.min(reach, 0) + np.max(reach, 0))
    return np.array([x + RADIUS, y])


def in_emulated_time(smoothing: Smoothing) -> Record:
    """Return the record of an emulated robot."""
    robot = EmulatedRobot(smoothing=smoothing)
    robot.enable()
    assert robot.drive_to(start_in(robot.setup.seat.reach))
    commands, paddle, begin = [], [], robot.now
    while robot.now < begin + SECONDS:
        velocity = velocity_at(robot.now - begin + CONTROL_DT)
        commands.append([robot.now, *velocity])
        robot.send_action(velocity, CONTROL_DT)
        for _ in range(25):
            robot.advance(0.002)
            paddle.append([robot.now, *robot.true_position[:2]])
    return Record(np.array(commands), np.array(paddle))


def in_real_time(lab: Lab, smoothing: Smoothing) -> Record:
    """Return the record of a robot whose client and controller are processes."""
    setup = lab.setup
    config = RobotConfig(
        *(lab.host, setup.mounting, setup.seat.reach), smoothing=smoothing
    )
    commands, paddle = [], []
    with Robot(config) as robot:
        robot.go_to(start_in(setup.seat.reach))
        begin = due = time.monotonic()
        while time.monotonic() < begin + SECONDS:
            if time.monotonic() >= due:
                velocity = velocity_at(due - begin + CONTROL_DT)
                robot.send_action(velocity, CONTROL_DT)
                commands.append([robot.commanded_at, *velocity])
                due += CONTROL_DT
            truth = lab.ask({"do": "truth"})
            paddle.append([truth["time"], *truth["paddle"][:2]])
            time.sleep(0.002)
    return Record(np.array(commands), np.array(paddle))


def reference_of(record: Record, times: Array) -> Array:
    """Return the positions of the commands' path at some times, m, (n, 2)."""
    fine = np.arange(record.commands[0, 0], times[-1], 0.001)
    sent, velocity = record.commands[:, 0], record.commands[:, 1:]
    before = np.vstack([np.zeros(2), velocity[:-1]])
    k = np.searchsorted(sent, fine, side="right") - 1
    share = np.clip((fine - sent[k]) / CONTROL_DT, 0.0, 1.0)[:, None]
    speeds = before[k] + share * (velocity[k] - before[k])
    path = record.paddle[0, 1:] + np.cumsum(speeds, 0) * 0.001
    return np.stack([np.interp(times, fine, axis) for axis in path.T], 1)


def judge(record: Record) -> tuple[float, float, float]:
    """Return the latency, s, and the tracking error, RMS and largest, m."""
    times, paddle = record.paddle[:, 0], record.paddle[:, 1:]
    steady = times > times[0] + RAMP + 0.5

    def errors(latency: float) -> Array:
        off = paddle - reference_of(record, times - latency)
        return np.asarray(np.linalg.norm(off[steady], axis=1))

    latency = min(
        np.arange(0.0, 0.3, 0.001), key=lambda delay: float(np.mean(errors(delay) ** 2))
    )
    left = errors(latency)
    return float(latency), float(np.sqrt(np.mean(left**2))), float(left.max())


def draw(record: Record, latency: float, file: Path) -> None:
    """Plot two seconds of a record."""
    times, paddle = record.paddle[:, 0], record.paddle[:, 1:]
    some = (times > times[0] + 3.0) & (times < times[0] + 5.0)
    reference = reference_of(record, times)
    late = reference_of(record, times - latency)
    t = times[some] - times[some][0]
    figure, ((left, right),) = panels(1, 2, (10, 4.2), widths=(2.2, 1))
    look, path = series(0), {"color": SOFT, "linestyle": "--"}
    left.plot(t, 1e3 * reference[some, 1], label="path of the commands", **path)
    left.plot(t, 1e3 * paddle[some, 1], color=look.colour, label="paddle")
    left.set(xlabel="time, s", ylabel="y, mm")
    right.plot(*1e3 * (late[some] - late[some].mean(0)).T, **path)
    right.plot(*1e3 * (paddle[some] - late[some].mean(0)).T, color=look.colour)
    right.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")
    right.set_title(f"the path {1e3 * latency:.0f} ms late")
    title = f"Two seconds of a circle at {SPEED} m/s, in real time, without a filter"
    save(figure, file, title)


def main(
    out: Annotated[Path | None, typer.Option(help="CSV file of the rows.")] = None,
    plot: Annotated[Path | None, typer.Option(help="PNG file of the movement.")] = None,
) -> None:
    """Measure every filter in emulated and in real time, and print a table."""
    rows = []
    print("| filter | clock | latency, ms | error, mm (RMS / largest) |")
    print("| --- | --- | --- | --- |")
    with Lab() as lab:
        for clock in ("emulated", "real"):
            for smoothing in map(Smoothing, FILTERS):
                record = (
                    in_emulated_time(smoothing)
                    if clock == "emulated"
                    else in_real_time(lab, smoothing)
                )
                latency, error, largest = judge(record)
                if plot and clock == "real" and smoothing.name == "none":
                    draw(record, latency, plot)
                case = smoothing.name, clock
                found = f"{1e3 * latency:.0f}", f"{1e3 * error:.1f}"
                rows.append((*case, *found, f"{1e3 * largest:.1f}"))
                print(f"| {' | '.join(rows[-1][:3])} | {' / '.join(rows[-1][3:])} |")
    if out:
        with out.open("w", newline="") as file:
            names = "filter", "clock", "latency_ms", "rms_mm", "largest_mm"
            csv.writer(file).writerows([names, *rows])


if __name__ == "__main__":
    typer.run(main)
