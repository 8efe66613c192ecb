"""Measure the latency of the lab from light to command and on to the arm.

    python scripts/bench/lab_latency.py --out docs/data/lab_latency.csv

The whole pipeline runs in real time: camera, vision, filter, policy, robot client and
emulated controller. Three times are measured and compared with those of the profile
`ur5e`:

* sensing: age of the newest frame with the puck when a decision begins, from the middle
  of its exposure, while a trained policy juggles;
* paddle: time from the start of the step with a new command until the true paddle has
  made half of the change of velocity, between rest and half of the top speed;
* answer: the sum of both, for all pairs of an age and a time of the paddle.

It takes about two minutes. Nothing else should run at the same time.
"""

from __future__ import annotations

import argparse
import csv
import threading
import time
from contextlib import closing
from pathlib import Path

import numpy as np

from marl_airhockey.build import build_driven_world, build_world
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.policies.load import load_policy
from marl_airhockey.sim.core.profiles import find_profile
from marl_airhockey.sim.jit.folders import cache_folder
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

STEPS, CHANGES, PAUSE = 400, 40, 8
"""Control steps of the juggling policy; changes of the command, and steps between
them."""
COMMANDS = (0.5, 0.0, -0.5, 0.0)
"""Commanded velocities along y, divided by the top speed, which are repeated."""
DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows."""
QUANTILES = (0.05, 0.5, 0.95)
"""Quantiles that are reported."""


def ages_of(keywords: Keywords) -> Array:
    """Return the ages of the newest frames with the puck at decisions, s."""
    policy = load_policy("zoo/juggle_full_size")
    world = build_driven_world(policy, "juggle", 1, keywords)
    ages = []
    with closing(world):
        world.reset(0)
        for _ in range(STEPS):
            world.step(np.zeros((1, 0, 2)))
            _, _, visible, age = world.sensor.history[0, -1, 0]
            if visible:
                ages.append(age)
    return np.array(ages)


class Watch(threading.Thread):
    """Thread that records the velocity of the true paddle.

    Args:
        lab: Lab with the paddle.
    """

    def __init__(self, lab: Lab) -> None:
        super().__init__(daemon=True)
        self._lab, self._on = lab, True
        self._rows: list[tuple[float, float]] = []

    def run(self) -> None:
        """Record time, s, and velocity along y, m/s, until `stop` is called."""
        while self._on:
            truth = self._lab.ask({"do": "truth"})
            self._rows.append((truth["time"], truth["paddle"][4]))
            time.sleep(0.004)

    def stop(self) -> Array:
        """Return the recorded rows (n, 2)."""
        self._on = False
        self.join()
        return np.array(self._rows)


def answers_of(lab: Lab, keywords: Keywords) -> Array:
    """Return the times from commands until half of the change of velocity, s."""
    limits: Keywords = {**keywords, "max_cycles": 10_000}
    world = build_world("reach", 1, autoreset=False, keywords=limits)
    watch, changes, old = Watch(lab), [], 0.0
    top = world.scene.seats[0].speed
    with closing(world):
        world.reset(0)
        watch.start()
        for change in range(CHANGES):
            new = COMMANDS[change % len(COMMANDS)]
            changes.append((time.monotonic(), 0.5 * (old + new) * top, new - old))
            for _ in range(PAUSE):
                world.step(np.array([[[0.0, new]]]))
            old = new
        track = watch.stop()
    times = []
    for begin, half, sign in changes:
        later = track[track[:, 0] >= begin]
        crossed = later[sign * (later[:, 1] - half) >= 0.0]
        times.append(crossed[0, 0] - begin)
    return np.array(times)


def assumed() -> dict[str, tuple[float, float]]:
    """Return the ranges of the profile, s."""
    ranges = find_profile("ur5e").ranges
    age, jitter = ranges["observation_delay"], ranges["observation_jitter"][1]
    rows = list(csv.DictReader((DATA / "answer_times.csv").open()))
    (row,) = (row for row in rows if row["profile"] == "ur5e")
    low, high = (float(x) / 1e3 for x in row["paddle_ms"].split(" .. "))
    both = (float(x) / 1e3 for x in row["answer_ms"].split(" .. "))
    return {
        "sensing": (age[0], age[1] + jitter),
        "paddle": (low, high),
        "answer": tuple(both),  # type: ignore[dict-item]
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, help="CSV file of the rows.")
    given = parser.parse_args()
    with Lab() as lab, served(lab, announce=False) as port:
        path = cache_folder() / f"latency-{port}.json"
        with closing(LabClient(port)) as client:
            calibrate_lab(client).save(path)
        keywords: Keywords = {"backend": "real", "rig": str(path)}
        ages, answers = ages_of(keywords), answers_of(lab, keywords)
        path.unlink()
    measured = {
        "sensing": ages,
        "paddle": answers,
        "answer": (ages[:, None] + answers).ravel(),
    }
    rows = []
    for name, times in measured.items():
        low, middle, high = 1e3 * np.quantile(times, QUANTILES)
        least, most = (1e3 * end for end in assumed()[name])
        row = {
            "part": name,
            "median_ms": f"{middle:.0f}",
            "range_ms": f"{low:.0f} .. {high:.0f}",
            "profile_ms": f"{least:.0f} .. {most:.0f}",
            "samples": len(ages) if name == "answer" else len(times),
        }
        rows.append(row)
        print(row)
    if given.out:
        with given.out.open("w", newline="") as file:
            table = csv.DictWriter(file, [*rows[0]], lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
