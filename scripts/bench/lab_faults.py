"""Measure the end of an episode when devices fail: each fault of the lab, and pairs.

    python scripts/bench/lab_faults.py --out docs/data/lab_faults.json

A trained policy juggles through camera and arm. After a second one or two faults are
switched on. Faults that were reported by others are omitted, see
`tests/hardware/emulated/test_fault_atlas.py`. The script prints

* the reason with which the episode ends, or ``continues`` if no end is observed,
* the time until then,
* the time until the true paddle is at rest permanently (below 0.01 m/s),
* the distance that the paddle moves after the end of the episode.

It takes about 30 minutes, or three with ``--alone``, in real time. Nothing else should
run at the same time. Faults whose rows are in the file are not measured again, so the
script can be interrupted. ``--summary`` prints the pairs of the file by reason.
"""

from __future__ import annotations

import argparse
import itertools
import json
import re
import time
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.build import build_driven_world
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.faults import ARM_FAULTS, TABLE_FAULTS
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.hardware.ur_emulator.faults import FAULTS
from marl_airhockey.policies.load import load_policy
from marl_airhockey.sim.jit.folders import cache_folder
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

BEFORE, LISTEN = 20, 80
"""Number of control steps before a fault, and largest number after it."""
REST = 2.0
"""Longest time for which the paddle is observed after the end of an episode, s."""
SETTLE = 1.0
"""Time from the end of a fault to the next episode, in which a lifted paddle comes
down, s."""
STILL = 0.01
"""Speed below which the paddle is at rest, m/s."""
QUIET = "local_control"
"""Fault that does not stop the running URScript of the controller."""


class Outcome(NamedTuple):
    """Outcome of an episode with faults."""

    reason: str
    """Reason of the end; "" if the episode continues."""
    ended_s: float
    """Time from the fault to the end, s; nan if the episode continues."""
    rest_s: float
    """Time from the fault until the paddle is at rest permanently, s; nan if it is
    not."""
    moved_m: float
    """Distance that the paddle moves after the end, m."""


def paddle_of(lab: Lab) -> Array:
    """Return time, s, position, m, and velocity, m/s, of the true paddle, (5,)."""
    truth = lab.ask({"do": "truth"})
    return np.array([truth["time"], *np.array(truth["paddle"])[[0, 1, 3, 4]]])


def play(lab: Lab, world: World, faults: tuple[str, ...], seed: int) -> Outcome | None:
    """Return the outcome of an episode; None if it ends before the faults."""
    no_actions, rows = np.zeros((1, 0, 2)), []
    world.reset(seed)
    for _ in range(BEFORE):
        result = world.step(no_actions)
        if result.terminated[0] or result.truncated[0]:
            return None
    begin = time.monotonic()
    for name in faults:
        lab.ask({"do": "fault", "name": name, "on": True})
    reason, ended = "", np.nan
    for _ in range(LISTEN):
        result = world.step(no_actions)
        rows.append(paddle_of(lab))
        if result.interruption:
            reason, ended = result.interruption, time.monotonic() - begin
            break
        if result.terminated[0] or result.truncated[0]:
            return None
    until, end = time.monotonic() + REST, paddle_of(lab)
    while reason and time.monotonic() < until:
        rows.append(paddle_of(lab))
        time.sleep(0.005)
    track = np.array(rows)
    moving = np.flatnonzero(np.hypot(track[:, 3], track[:, 4]) > STILL)
    rested = moving[-1] + 1 if moving.size else 0
    rests = reason and rested < len(track)
    rest = float(track[rested, 0]) - begin if rests else np.nan
    moved = float(np.linalg.norm(track[-1, 1:3] - end[1:3])) if reason else np.nan
    return Outcome(reason, ended, rest, moved)


def measure(
    lab: Lab, world: World, faults: tuple[str, ...], seeds: itertools.count[int]
) -> dict[str, object]:
    """Return the row of some faults."""
    outcome = None
    while outcome is None:
        try:
            outcome = play(lab, world, faults, next(seeds))
        finally:
            for name in faults:
                lab.ask({"do": "fault", "name": name, "on": False})
            time.sleep(SETTLE)
    row: dict[str, object] = {"faults": " + ".join(faults), "reason": outcome.reason}
    numbers = outcome._asdict()
    del numbers["reason"]
    for name, value in numbers.items():
        row[name] = None if np.isnan(value) else round(float(value), 3)
    return row


def show(row: dict[str, object]) -> None:
    """Print a row of the table."""
    cells = [str(row["faults"]), str(row["reason"] or "continues")]
    for name, scale in (("ended_s", 1e3), ("rest_s", 1e3), ("moved_m", 1e3)):
        value = row[name]
        cells.append("" if value is None else f"{scale * float(str(value)):.0f}")
    print(f"| {' | '.join(cells)} |", flush=True)


def summary_of(rows: list[dict[str, Any]]) -> list[dict[str, str]]:
    """Return the number of pairs for each reason of an end, and their worst values."""
    pairs: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        if "+" in row["faults"]:
            words = row["reason"].split(";")[0]
            reason = re.sub(r"[\d.]*\d", "N", words) or "continues"
            pairs.setdefault(reason, []).append(row)

    def worst(found: list[dict[str, Any]], column: str) -> str:
        numbers = [row[column] for row in found if row[column] is not None]
        return f"{1e3 * max(numbers):.0f}" if numbers else ""

    return [
        {
            "reason of the end": reason,
            "pairs": str(len(found)),
            "episode ends, ms": worst(found, "ended_s"),
            "at rest, ms": worst(found, "rest_s"),
            "moved on, mm": worst(found, "moved_m"),
        }
        for reason, found in sorted(pairs.items())
    ]


def print_summary(rows: list[dict[str, Any]]) -> None:
    """Print the table of the pairs."""
    table = summary_of(rows)
    for cells in ([*table[0]] if table else [], *([*row.values()] for row in table)):
        print(f"| {' | '.join(cells)} |")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--alone", action="store_true", help="Measure no pairs of faults."
    )
    parser.add_argument("--out", type=Path, help="JSON file of the rows.")
    parser.add_argument(
        "--summary", type=Path, help="File whose pairs are printed instead."
    )
    given = parser.parse_args()
    if given.summary:
        print_summary(json.loads(given.summary.read_text()))
        return
    arm = [name for name in ARM_FAULTS if not FAULTS[name].source and name != QUIET]
    names = [*arm, *TABLE_FAULTS]
    groups: list[tuple[str, ...]] = [(name,) for name in names]
    if not given.alone:
        groups += itertools.combinations(names, 2)
    known = given.out is not None and given.out.exists()
    rows = json.loads(given.out.read_text()) if known else []
    done, seeds = {row["faults"] for row in rows}, itertools.count(1 + len(rows))
    print("| faults | reason | episode ends, ms | at rest, ms | moved on, mm |")
    print("| --- | --- | --- | --- | --- |")
    with Lab() as lab, served(lab, announce=False) as port:
        path = cache_folder() / f"faults-{port}.json"
        with closing(LabClient(port)) as client:
            calibrate_lab(client).save(path)
        policy = load_policy("zoo/juggle_full_size")
        keywords: Keywords = {"backend": "real", "rig": str(path)}
        world = build_driven_world(policy, "juggle", 1, keywords)
        try:
            for group in groups:
                if " + ".join(group) in done:
                    continue
                rows.append(measure(lab, world, group, seeds))
                show(rows[-1])
                if given.out:
                    given.out.write_text(json.dumps(rows, indent=1) + "\n")
        finally:
            world.close()
            path.unlink()
    print_summary(rows)


if __name__ == "__main__":
    main()
