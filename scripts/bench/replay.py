"""Replay 1,000 recorded episodes of every scenario and compare all columns.

    python scripts/bench/replay.py --episodes 1000

The script prints the steps of each scenario and the largest difference of any column:
states, memory, observations, reward terms, success and ends. Scripts play at all seats,
for at most 160 steps.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

import marl_airhockey as ah
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.summary import summarize_recording
from marl_airhockey.data.verify import replay_differences
from marl_airhockey.sim.world.keywords import Keywords


def replayed(name: str, profile: str, episodes: int, folder: Path) -> str:
    """Record and replay a scenario; return a row of the table."""
    seats = len(ah.make_scenario(name).scene.seats)
    driver = "reacher" if name.startswith("reach") else "striker"
    drivers = {f"paddle_{i}": "striker" for i in range(1, seats)}
    keywords: Keywords = {"max_cycles": 160, "drivers": drivers, "profile": profile}
    path = folder / f"{name}-{profile}"
    began = time.process_time()
    record_episodes(ah.make_driver(driver), driver, name, episodes, path, 7, keywords)
    largest = max(replay_differences(path).values())
    steps, spent = summarize_recording(path).steps, time.process_time() - began
    return f"| {name} | {profile} | {steps} | {largest:.1e} | {spent:.0f} |"


def main(
    episodes: Annotated[
        int, typer.Option(help="Number of episodes of each scenario.")
    ] = 1000,
    profiles: Annotated[
        str, typer.Option(help="Names of profiles, separated by commas.")
    ] = "ideal",
) -> None:
    """Print the table."""
    print("| scenario | profile | steps | largest difference | CPU time, s |")
    print("| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for profile in profiles.split(","):
            for name in ah.scenario_names():
                print(replayed(name, profile, episodes, Path(folder)), flush=True)


if __name__ == "__main__":
    typer.run(main)
