"""Command ``airhockey play``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marl_airhockey.cli.environment import (
    EnvironmentOptions,
    as_trained_unless_given,
    in_environment,
)
from marl_airhockey.cli.hosting import Browser, Host, Port, host_match
from marl_airhockey.cli.options import console, settings
from marl_airhockey.cli.progress import waiting
from marl_airhockey.play.handicap import BOUNDS, Handicap
from marl_airhockey.play.ladder import RUNGS, USUAL, usual_level
from marl_airhockey.registry import REAL, make_driver, scenario_names
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.world.keywords import Keywords

if TYPE_CHECKING:
    from marl_airhockey.play.live_match import LiveMatch

FIRST = "duel"
"""Game of a page on which players choose."""
Reaction = Annotated[
    float | None,
    typer.Option(
        help="Additional latency with which drivers that are not people observe, s.",
        min=BOUNDS["reaction"][0],
        max=BOUNDS["reaction"][1],
    ),
]
Noise = Annotated[
    float | None,
    typer.Option(
        help="Standard deviation of the error with which these drivers observe pucks, "
        "m.",
        min=BOUNDS["noise"][0],
        max=BOUNDS["noise"][1],
    ),
]
Pace = Annotated[
    float | None,
    typer.Option(
        help="Largest speed of these drivers, as a fraction of the top speed.",
        min=BOUNDS["pace"][0],
        max=BOUNDS["pace"][1],
    ),
]


@in_environment
def play(
    environment: EnvironmentOptions,
    scenario: Annotated[
        str | None,
        typer.Argument(
            help="Name of a scenario; without it, players choose among all games and "
            "tasks on the page."
        ),
    ] = None,
    opponent: Annotated[
        str | None,
        typer.Option(
            help="Level of the ladder or driver of all other seats; by default "
            f"{USUAL!r}."
        ),
    ] = None,
    reaction: Reaction = None,
    noise: Noise = None,
    pace: Pace = None,
    tournament: Annotated[
        bool,
        typer.Option(
            "--tournament",
            help="Host a knock-out tournament: people enter their names on the page "
            "and play in pairs.",
        ),
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(
            help="Folder in which every episode is recorded; by default nothing is "
            "recorded."
        ),
    ] = None,
    keep: Annotated[
        int,
        typer.Option(
            help="Largest number of recordings of this table; the oldest are deleted.",
            min=1,
        ),
    ] = 1000,
    host: Host = "127.0.0.1",
    port: Port = 8480,
    browser: Browser = True,
    static: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of a page that plays without this library, on any web server. "
            "The command only writes the folder.",
        ),
    ] = None,
) -> None:
    """Play in the browser against a policy, a script or other people.

    --driver AGENT=person gives a seat to a person. --reaction, --noise and --pace limit
    all drivers that are not people, instead of the limits of their level.
    """
    if static is not None:
        _write_page(static, scenario)
        return
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.game_menu import GameMenu
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.match_drivers import PERSON
    from marl_airhockey.play.real_match import RealMatch

    kind = RealMatch if environment.backend == REAL else LiveMatch
    seats = settings(environment.driver)
    limits = {"reaction": reaction, "noise": noise, "pace": pace}
    handicap = Handicap(**{k: v for k, v in limits.items() if v is not None})

    def prepare(name: str, keywords: Keywords) -> LiveMatch:
        match = kind(name, {}, keywords, handicap)
        seat_drivers(match, opponent, seats)
        match.warm_up()
        return match

    keywords = environment.keywords
    keywords.pop("drivers", None)
    keywords.setdefault("control_dt", kind.CONTROL_DT)
    if scenario is not None:
        keywords = _as_trained(scenario, {opponent, *seats.values()}, keywords)
    chooses = scenario is None and kind is LiveMatch and not tournament
    names = scenario_names() if chooses else []
    menu = GameMenu(names, lambda name: prepare(name, keywords))
    with environment.table(keywords) as table:
        with waiting("preparing the table (the first time takes longer)"):
            match = prepare(scenario or FIRST, table)
        if record:
            console.print(f"recordings: {record}, at most {keep} of this table")
        if tournament:
            for i in range(len(match.seats)):
                match.set_driver(i, PERSON)
        pages = record, host, port, browser
        host_match(match, *pages, keep=keep, menu=menu, tournament=tournament)


def _write_page(out: Path, scenario: str | None) -> None:
    """Write a page without a server, with one game or all games."""
    from marl_airhockey.play.static_page import write_static_page

    others = [name for name in scenario_names() if name != FIRST]
    files = write_static_page(out, [scenario] if scenario else [FIRST, *others])
    size = sum(file.stat().st_size for file in files) / 1e6
    console.print(f"wrote {out}: {len(files)} files, {size:.2f} MB", soft_wrap=True)
    console.print(f"play: python -m http.server --directory {out}", soft_wrap=True)


def _as_trained(scenario: str, names: set[str | None], given: Keywords) -> Keywords:
    """Complete the keywords with those in which the policies were trained."""
    from marl_airhockey.play.match_drivers import PERSON

    levels = [name for name, _, _ in RUNGS]
    chosen = sorted(str(n) for n in names if n not in (None, PERSON, *levels))
    players = {name: make_driver(name) for name in chosen}
    _, keywords, _ = as_trained_unless_given(players, scenario, given)
    keywords.pop("drivers", None)  # `seat_drivers` sets the driver of every seat.
    return keywords


def seat_drivers(match: LiveMatch, opponent: str | None, seats: dict[str, Any]) -> None:
    """Set the driver of each seat: a person for the first, an opponent for the others.

    Args:
        match: Match that has not started.
        opponent: Level or driver of all other seats that are not in ``seats``; None for
            the default level.
        seats: Chosen levels and drivers, by agent.
    """
    from marl_airhockey.play.match_drivers import PERSON

    levels = {level.name: level for level in match.drivers.ladder}
    rest = opponent or usual_level(match.drivers.ladder).name
    chosen = {str(agent): str(name) for agent, name in seats.items()}
    for i in range(len(match.seats)):
        agent = f"paddle_{i}"
        name = chosen.pop(agent, PERSON if i == 0 else rest)
        if name not in levels:
            match.set_driver(i, name)
        else:
            limits = None if match.handicap != Handicap() else levels[name].handicap
            match.set_driver(i, levels[name].driver, limits)
    if chosen:
        scenario = match.world.scenario.name
        raise ValueError(f"--driver: {scenario} has no agent {', '.join(chosen)}")
