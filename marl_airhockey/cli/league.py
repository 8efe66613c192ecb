"""Command ``airhockey league``."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.environment import (
    SimulationOptions,
    as_trained_unless_given,
    in_environment,
)
from marl_airhockey.cli.options import AsJson, console
from marl_airhockey.cli.progress import bar
from marl_airhockey.evaluation.league import LEAGUE_SEED, find_policies, league
from marl_airhockey.evaluation.standings import Standings
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.errors import require

SCRIPTS = (
    "random",
    *(
        f"{script}:strength={strength}"
        for script in ("goalkeeper", "striker", "allround")
        for strength in ("weak", "fair", "strong")
    ),
)
"""Names of the scripts that play if no players are given."""


@in_environment
def play_league(
    scenario: Annotated[
        str, typer.Argument(help="Name of a game with two or more sides.")
    ],
    environment: SimulationOptions,
    players: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of drivers and paths of policies; by default random, and "
            "goalkeeper, striker and allround in three strengths."
        ),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(help="Folder whose policies and runs play in addition."),
    ] = None,
    games: Annotated[
        int, typer.Option(help="Number of games of each pair, an even number.", min=2)
    ] = 100,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the tables and plots.")
    ] = Path("runs/league"),
    seed: Annotated[int, typer.Option(help="Seed of the first game.")] = LEAGUE_SEED,
    exploit: Annotated[
        int | None,
        typer.Option(
            help="Number of steps for which a best response to each player is trained; "
            "by default none is trained.",
            min=1,
        ),
    ] = None,
    exploit_seeds: Annotated[
        int,
        typer.Option(
            help="Number of best responses to each player; their seeds are 0, 1, ...",
            min=1,
        ),
    ] = 1,
    as_json: AsJson = False,
) -> None:
    """Let every player play against every other: ratings, results of pairs, cycles."""
    require("matplotlib", "train")
    given = players or ([] if folder else SCRIPTS)
    entries = [*given, *(find_policies(folder) if folder else [])]
    names = [str(entry) for entry in entries]
    entrants = {label(str(entry), names): make_driver(entry) for entry in entries}
    _, keywords, entrants = as_trained_unless_given(
        entrants, scenario, environment.keywords, as_json
    )
    with bar() as progress:
        task = progress.add_task(f"league of {len(entrants)}", total=1.0, note="")
        standings = league(
            scenario,
            entrants,
            games=games,
            seed=seed,
            exact=True,
            report=lambda share: progress.update(task, completed=share),
            **keywords,
        )
    files = standings.save(out)
    responses: dict[str, list[float]] = {}
    if exploit:
        responses = best_responses(scenario, names, exploit, exploit_seeds, out)
        (out / "exploitability.json").write_text(json.dumps(responses, indent=1))
    if as_json:
        report = {**standings.to_json(), "best_responses": responses}
        console.print_json(json.dumps(report))
        return
    console.print(table(standings))
    for cycle in standings.cycles:
        console.print("cycle:", " > ".join((*cycle, cycle[0])))
    for name, scores in responses.items():
        shown = ", ".join(f"{score:.3f}" for score in scores)
        console.print(f"best response to {name} after {exploit:,} steps: {shown}")
    console.print("files:", *files)


def label(name: str, names: list[str]) -> str:
    """Return the last two parts of a path, or the path if these are not unique."""
    short = "/".join(Path(name).parts[-2:])
    return short if sum(n.endswith(short) for n in names) == 1 else name


def best_responses(
    scenario: str, names: list[str], steps: int, seeds: int, out: Path
) -> dict[str, list[float]]:
    """Train a best response to each player and return its scores, by player.

    Args:
        scenario: Name of a game with two or more sides.
        names: Names of the players.
        steps: Number of training steps of each best response.
        seeds: Number of best responses to each player; their seeds are 0 .. seeds - 1.
        out: Folder of the league; runs are in its subfolder ``responses``.

    Returns:
        Scores in the order of seeds, by player.
    """
    require("stable_baselines3", "train")
    from marl_airhockey.learn.best_response import best_response

    found: dict[str, list[float]] = {name: [] for name in names}
    with bar() as progress:
        total = seeds * len(names)
        task = progress.add_task("best responses", total=total, note="")
        for number, (name, seed) in enumerate(product(names, range(seeds))):

            def report(
                done: int, of: int, row: dict[str, float], number: int = number
            ) -> None:
                progress.update(task, completed=number + done / of)

            progress.update(task, note=name)
            run = out / "responses" / f"{number // seeds}-{steps}-{seed}"
            found[name].append(best_response(scenario, name, steps, run, seed, report))
    return found


def table(standings: Standings) -> Table:
    """Return a table of the players, sorted from the best to the worst."""
    names = ("player", "Elo", "95 %", "score", "Nash", "won", "drawn", "lost", "goals")
    shown = Table(*names)
    for row in standings.rows():
        shown.add_row(
            row["player"],
            f"{row['elo']:.0f}",
            f"{row['elo_low']:.0f}..{row['elo_high']:.0f}",
            f"{row['score']:.3f}",
            f"{row['nash_share']:.2f}",
            f"{row['wins']}",
            f"{row['draws']}",
            f"{row['losses']}",
            f"{row['goal_difference']:+.2f}",
        )
    return shown
