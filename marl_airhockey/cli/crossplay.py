"""Command ``airhockey crossplay``."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.environment import (
    SimulationOptions,
    as_trained_unless_given,
    in_environment,
)
from marl_airhockey.cli.options import AsJson, Drivers, console, settings
from marl_airhockey.cli.progress import bar
from marl_airhockey.evaluation.crossplay import CrossPlay
from marl_airhockey.evaluation.crossplay import crossplay as play_crossplay
from marl_airhockey.evaluation.evaluate import TEST_SEED
from marl_airhockey.registry import make_driver


@in_environment
def crossplay(
    scenario: Annotated[
        str, typer.Argument(help="Name of a game with teams of two or more.")
    ],
    players: Annotated[
        list[str], typer.Argument(help="Names of drivers and paths of policies.")
    ],
    environment: SimulationOptions,
    episodes: Annotated[
        int, typer.Option(help="Number of episodes of each pair.", min=1)
    ] = 200,
    driver: Drivers = None,
    seed: Annotated[int, typer.Option(help="Seed of the first episode.")] = TEST_SEED,
    as_json: AsJson = False,
) -> None:
    """Measure how well players coordinate with teammates that they do not know.

    Every player plays with itself and with every other player. The coordination gap is
    the difference between the two mean returns.
    """
    keywords = environment.keywords
    if driver:
        keywords["drivers"] = settings(driver)
    teammates = {name: make_driver(name) for name in players}
    _, keywords, teammates = as_trained_unless_given(
        teammates, scenario, keywords, as_json
    )
    with bar() as progress:
        task = progress.add_task("pairs", total=len(teammates) ** 2, note="")
        found = play_crossplay(
            scenario,
            teammates,
            episodes=episodes,
            seed=seed,
            exact=True,
            report=lambda pairs: progress.update(task, completed=pairs),
            **keywords,
        )
    if as_json:
        console.print_json(json.dumps(found.to_json()))
        return
    console.print(table(found))
    low, high = found.gap_interval
    console.print(
        f"with itself {found.self_play:.2f}, with others {found.cross_play:.2f}, "
        f"gap {found.gaps.mean():.2f} ({low:.2f}..{high:.2f})"
    )


def table(found: CrossPlay) -> Table:
    """Return a table of return and success of all pairs; columns are teammates."""
    shown = Table("player", *found.names, title="return (success) with the teammate")
    for name, returns, success in zip(
        found.names, found.returns, found.success, strict=True
    ):
        pairs = zip(returns, success, strict=True)
        shown.add_row(name, *(f"{value:.2f} ({share:.2f})" for value, share in pairs))
    return shown
