"""Measure the latency of each profile from an event to half of the velocity step.

    python scripts/reproduce/answer_times.py --out docs/data/answer_times.csv

In every episode a paddle at rest is commanded half of its top speed. The end-to-end
latency is a sum of two times. The first is the observation latency at some step. The
second is the time from the command until the paddle has half of this velocity: dead
time, servo and acceleration. The worlds make 200 control steps per second, so the
velocity is known every 5 ms. The time until the next decision, up to a control step, is
not included.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import marl_airhockey as ah
from marl_airhockey.sim.core.profiles import PROFILES
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

STEP, STEPS, SHARE = 0.005, 200, 0.5
"""Control step of the measurement, s; number of steps; action."""


def measure(profile: str, episodes: int) -> tuple[Array, Array]:
    """Return observation latencies and times to half of the velocity step, s."""
    # Without tilt, drag and contacts, the velocity of a puck is constant.
    level = {"tilt": 0.0, "slope": 0.0, "puck_drag": 0.0, "puck_damping": 0.0}
    quiet = {"position_noise": 0.0, "calibration_error": 0.0, "occlusion": 0.0}
    world = ah.make_world(
        "touch",
        episodes,
        profile=profile,
        control_dt=STEP,
        observe="velocity",
        max_cycles=10 * STEPS,
        physics={**level, **quiet, "false_detection": 0.0},
    )
    world.reset(0)
    state, _ = world.get_state()
    state.paddle[:], state.paddle_velocity[:] = (-0.6, 0.0), 0.0
    state.puck[:, 0], state.puck_velocity[:, 0] = (0.2, -0.1), (0.0, 0.1)
    world.set_state(state)
    speeds, ages = [np.zeros(episodes)], []
    for _ in range(STEPS):
        world.step(np.full((episodes, 1, 2), (SHARE, 0.0)))
        speeds.append(world.state.paddle_velocity[:, 0, 0])
        gap = world.state.puck[:, 0] - world.sensed.puck[:, 0]
        ages.append(gap[:, 1] / world.state.puck_velocity[:, 0, 1])
        if min(speeds[-1]) > 0.5 * SHARE * world.scene.seats[0].speed:
            break
    return np.array(ages[-1]), half_times(np.array(speeds).T, world)


def half_times(speeds: Array, world: World) -> Array:
    """Return the times at which speeds (episodes, steps) reach half of a command, s."""
    half = 0.5 * SHARE * world.episode.physics["paddle_speed"]
    after = (speeds >= half[:, None]).argmax(1)
    rows = np.arange(len(speeds))
    low, high = speeds[rows, after - 1], speeds[rows, after]
    return np.asarray(STEP * (after - 1 + (half - low) / (high - low)))


def main(
    episodes: Annotated[int, typer.Option(help="Number of episodes.")] = 4000,
    out: Annotated[Path | None, typer.Option(help="CSV file of the rows.")] = None,
) -> None:
    """Measure all profiles and print a row for each."""
    rows = []
    for profile in PROFILES:
        ages, answers = measure(profile, episodes)
        row: dict[str, object] = {"profile": profile, "episodes": episodes}
        for name, times in (
            ("sensing_ms", ages),
            ("paddle_ms", answers),
            ("answer_ms", ages + answers),
        ):
            low, high = 1000 * times.min(), 1000 * times.max()
            row[name] = f"{low:.0f} .. {high:.0f}" if high - low > 0.5 else f"{low:.0f}"
        rows.append(row)
        print(row, flush=True)
    if out:
        with out.open("w", newline="") as file:
            table = csv.DictWriter(file, [*rows[0]], lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    typer.run(main)
