"""Commands ``airhockey suite list | run | watch``."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.box import SIMPLE
from rich.table import Table

from marl_airhockey.cli.environment import SimulationOptions, in_environment
from marl_airhockey.cli.options import AsJson, Video, console
from marl_airhockey.evaluation.suites.pieces import suite_names
from marl_airhockey.evaluation.suites.solution import Solution
from marl_airhockey.evaluation.suites.suite import (
    PairedDifference,
    SuitePlay,
    SuiteResult,
    load_suite,
)
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.watch import show_episodes

Player = Annotated[
    str,
    typer.Argument(metavar="DRIVER", help="Name of a driver, or path of a policy."),
]

suite = typer.Typer(
    help="Measure drivers on set pieces: fixed situations of a game with a task.",
    no_args_is_help=True,
)


@suite.command("list")
def list_suites(as_json: AsJson = False) -> None:
    """List the suites with their tasks."""
    found = [load_suite(name) for name in suite_names()]
    if as_json:
        tasks = [{"name": s.name, **asdict(s.pieces.task)} for s in found]
        console.print_json(json.dumps(tasks))
        return
    table = Table("suite", "game", "task", "pieces", "seconds", box=SIMPLE)
    for s in found:
        shown = str(len(s)), f"{s.scenario.seconds:g}"
        table.add_row(s.name, s.pieces.task.game, s.title, *shown)
    console.print(table)


@suite.command()
@in_environment
def run(
    player: Player,
    environment: SimulationOptions,
    suites: Annotated[
        list[str] | None,
        typer.Argument(help="Names or files of suites; by default all suites."),
    ] = None,
    against: Annotated[
        str, typer.Option(help="Other driver, compared on the same pieces.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Let a driver play all pieces of suites, and print its success.

    The columns 1 to 5 have the success in the classes of difficulty, the easiest first.
    With --json, the result of each piece is printed, too.
    """
    keywords = environment.keywords
    options = keywords.pop("options", {})
    results, plays, pairs = list[SuiteResult](), list[SuitePlay](), {}
    for name in suites or suite_names():
        chosen = load_suite(name, **options)
        players = [player, against] if against else [player]
        played = [chosen.play(make_driver(p), **keywords) for p in players]
        results += map(chosen.summarize, players, played)
        plays += played
        if against:
            pairs[name] = PairedDifference.of(*(each.solved for each in played))
    if as_json:
        data = {
            "results": [
                {**asdict(result), "solved": play.solved.tolist()}
                for result, play in zip(results, plays, strict=True)
            ],
            "differences": {name: asdict(pair) for name, pair in pairs.items()},
        }
        console.print_json(json.dumps(data))
        return
    console.print(table_of(results))
    for name, pair in pairs.items():
        console.print(
            f"{name}: only {player} solves {pair.only_first} pieces, only {against} "
            f"{pair.only_second} (McNemar, p = {pair.p_value:.3g})",
            soft_wrap=True,
            highlight=False,
        )


@suite.command()
@in_environment
def watch(
    player: Player,
    name: Annotated[
        str, typer.Argument(metavar="SUITE", help="Name or file of a suite.")
    ],
    environment: SimulationOptions,
    piece: Annotated[int, typer.Option(help="Number of the first piece.", min=0)] = 0,
    pieces: Annotated[int, typer.Option(help="Number of pieces.", min=1)] = 1,
    video: Video = None,
) -> None:
    """Show pieces of a suite, or write a video of them.

    The driver "solution" repeats the stored actions that solve each piece.
    """
    keywords = environment.keywords
    chosen = load_suite(name, **keywords.pop("options", {}))
    found = Solution(name) if player == "solution" else player
    driver, scenario, given = chosen.prepare(found, **keywords)
    show_episodes(scenario, driver, given, piece, pieces, video)
    if video is not None:
        console.print(f"wrote {video} ({video.stat().st_size // 1000} kB)")


def table_of(results: list[SuiteResult]) -> Table:
    """Return the table of results."""
    table = Table("suite", box=SIMPLE, pad_edge=False)
    table.add_column("driver", overflow="fold")
    for title in ("success", "95 %", *"12345"):
        table.add_column(title, no_wrap=True)
    for found in results:
        low, high = found.success_interval
        table.add_row(
            *(found.suite, found.driver, f"{found.success:.3f}"),
            f"{low:.2f}..{high:.2f}",
            *("-" if share is None else f"{share:.2f}" for share in found.by_class),
        )
    return table
