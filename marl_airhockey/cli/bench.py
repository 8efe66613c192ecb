"""Command ``airhockey bench``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.options import (
    AsJson,
    Workers,
    console,
)
from marl_airhockey.cli.progress import bar
from marl_airhockey.sim.core.errors import require


def bench_environments(
    scenario: Annotated[
        str, typer.Option(help="Names of scenarios, separated by commas.")
    ] = "juggle",
    backend: Annotated[
        str,
        typer.Option(
            help="Backends, separated by commas: numba, pymunk and robosuite."
        ),
    ] = "numba,pymunk",
    worlds: Annotated[
        str,
        typer.Option(
            help="Numbers of worlds, separated by commas; 0 is the PettingZoo "
            "environment of one world."
        ),
    ] = "0,1,64,1024,4096",
    observe: Annotated[
        list[str] | None,
        typer.Option(
            help="Observation type, by default velocity. Can be repeated; images are "
            "pixels or pixels:size=64,colour=rgb,frames=1."
        ),
    ] = None,
    rounds: Annotated[
        int,
        typer.Option(help="Number of rounds; each round measures every case once."),
    ] = 3,
    seconds: Annotated[
        float, typer.Option(help="Duration of one measurement, CPU-seconds.")
    ] = 1.0,
    out: Annotated[
        Path | None, typer.Option(help="PNG file to write with a plot of the rates.")
    ] = None,
    num_workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Measure environment steps per CPU-second and per second of wall time."""
    from marl_airhockey.evaluation.speed import Case, measure_speed, plot_speed

    try:
        numbers = [int(n) for n in worlds.split(",")]
    except ValueError:
        raise ValueError(
            f"--worlds {worlds!r}: expected whole numbers, separated by commas"
        ) from None
    if min(numbers) < 0 or rounds < 1 or seconds <= 0:
        raise ValueError(
            "expected --worlds of at least 0, --rounds of at least 1 and --seconds "
            "above 0"
        )
    cases = [
        Case(s, b, n, o)
        for s in scenario.split(",")
        for b in backend.split(",")
        for o in observe or ["velocity"]
        for n in numbers
    ]
    with bar() as progress:
        task = progress.add_task("measuring", total=rounds * len(cases), note="")
        rates = measure_speed(cases, rounds, seconds, lambda: progress.advance(task))
    if out is not None:
        require("matplotlib", "train")
        plot_speed(rates, out)
    if as_json:
        console.print_json(json.dumps([rate.to_json() for rate in rates]))
        return
    table = Table(
        title=f"{rounds} rounds of {seconds} CPU-s, {rates[0].threads} threads"
    )
    for name in ("scenario", "backend", "observe", ""):
        table.add_column(name, overflow="fold")
    for name in ("env-steps per CPU-s", "agent-steps per CPU-s", "per s", "spread"):
        table.add_column(name, justify="right")
    for rate in rates:
        speeds = (rate.env_steps_per_cpu_s, rate.agent_steps_per_cpu_s)
        table.add_row(
            rate.case.scenario,
            rate.case.backend,
            rate.case.observe,
            rate.case.name,
            *(f"{speed:,.0f}" for speed in (*speeds, rate.env_steps_per_s)),
            f"{rate.spread:.0%}",
        )
    console.print(table)
    if out is not None:
        console.print(f"wrote {out}")
