"""Command ``airhockey play``."""

from __future__ import annotations

import contextlib
import socket
import threading
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marl_airhockey.cli.environment import (
    EnvironmentOptions,
    as_trained_unless_given,
    in_environment,
)
from marl_airhockey.cli.options import console, settings
from marl_airhockey.cli.progress import waiting
from marl_airhockey.play.handicap import BOUNDS, Handicap
from marl_airhockey.play.ladder import RUNGS, USUAL, usual_level
from marl_airhockey.registry import REAL, make_driver
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.world.keywords import Keywords

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from marl_airhockey.play.access import AccessCheck
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.open_table import Plant

Host = Annotated[
    str,
    typer.Option(
        help="Network address of the page; 0.0.0.0 serves it on all networks, with an "
        "access token in the printed link."
    ),
]
Port = Annotated[
    int,
    typer.Option(help="Port of the page; 0 selects a free port.", min=0, max=65535),
]
Browser = Annotated[bool, typer.Option(help="Open the page in the browser.")]
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
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")],
    environment: EnvironmentOptions,
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
) -> None:
    """Play in the browser against a policy, a script or other people.

    --driver AGENT=person gives a seat to a person. --reaction, --noise and --pace limit
    all drivers that are not people, instead of the limits of their level.
    """
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.real_match import RealMatch

    kind = RealMatch if environment.backend == REAL else LiveMatch
    keywords, seats = environment.keywords, settings(environment.driver)
    keywords.pop("drivers", None)
    keywords.setdefault("control_dt", kind.CONTROL_DT)
    keywords = _as_trained(scenario, {opponent, *seats.values()}, keywords)
    limits = {"reaction": reaction, "noise": noise, "pace": pace}
    given = {name: value for name, value in limits.items() if value is not None}
    with environment.table(keywords) as table:
        match = kind(scenario, {}, table, Handicap(**given))
        seat_drivers(match, opponent, seats)
        with waiting("preparing the table (the first time takes longer)"):
            match.warm_up()
        if record:
            console.print(f"recordings: {record}, at most {keep} of this table")
        host_match(match, record, host, port, browser, keep=keep)


def _as_trained(scenario: str, names: set[str | None], given: Keywords) -> Keywords:
    """Complete the keywords with those in which the policies were trained."""
    from marl_airhockey.play.match_drivers import PERSON

    levels = [name for name, _, _ in RUNGS]
    chosen = sorted(str(n) for n in names if n not in (None, PERSON, *levels))
    players = {name: make_driver(name) for name in chosen}
    _, keywords, _ = as_trained_unless_given(players, scenario, given)
    keywords.pop("drivers", None)  # `seat_drivers` sets the driver of every seat.
    return keywords


def host_match(
    match: LiveMatch,
    record: Path | None,
    host: str,
    port: int,
    browser: bool,
    film: bool = False,
    keep: int | None = None,
) -> None:
    """Serve a match until interrupted; in the virtual lab, with buttons for its faults.

    Args:
        match: Match to serve.
        record: Folder of the recordings; None to record nothing.
        host: Network address of the page.
        port: Port of the page; 0 for a free one.
        browser: True to open the page.
        film: True to record the video of a real table's camera.
        keep: Largest number of recordings of this table; None for no limit.
    """
    from marl_airhockey.play.open_table import open_table
    from marl_airhockey.play.real_match import RealMatch
    from marl_airhockey.play.recorder import Recorder
    from marl_airhockey.play.server import application

    filmed = match.backend.camera if film and isinstance(match, RealMatch) else None
    recorder = Recorder(record, filmed, keep) if record else None
    with contextlib.ExitStack() as stack:
        plant = None
        if isinstance(match, RealMatch):
            plant = stack.enter_context(lab_plant(match.backend.rig.operator))
        session = open_table(match, recorder, plant)
        name = match.world.scenario.name
        # Only the virtual lab has faults that can be switched.
        guarded = plant is not None and not plant.faults
        host_table(
            lambda access: application(session, access),
            *(name, host, port, browser),
            guarded=guarded,
        )
    if session.failure is not None:
        raise session.failure


@contextlib.contextmanager
def lab_plant(operator: str) -> Iterator[Plant]:
    """Yield the faults of the virtual lab, or no faults for another table.

    Args:
        operator: Operator of the table, see `rig.Rig.operator`.
    """
    from marl_airhockey.hardware.lab.faults import FAULTS
    from marl_airhockey.hardware.lab.lab import LabClient
    from marl_airhockey.play.open_table import Plant

    kind, _, port = operator.partition(":")
    if kind != "lab":
        yield Plant()
        return
    client = LabClient(int(port))

    def switch(name: str, on: bool) -> None:
        with contextlib.suppress(RuntimeError):
            client.ask("fault", name=name, on=on)

    yield Plant(FAULTS, switch)
    client.close()


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
        elif match.handicap == Handicap():
            match.set_level(i, levels[name])
        else:
            match.set_driver(i, levels[name].driver)
    if chosen:
        scenario = match.world.scenario.name
        raise ValueError(f"--driver: {scenario} has no agent {', '.join(chosen)}")


def show(recording: Path, host: str, port: int, browser: bool) -> None:
    """Show a recording in the browser until interrupted."""
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.server import replay

    name = recording.name
    host_table(lambda access: replay(recording, access), name, host, port, browser)


def host_table(
    make: Callable[[AccessCheck], Starlette],
    what: str,
    host: str,
    port: int,
    browser: bool,
    guarded: bool = False,
) -> None:
    """Serve an application until interrupted, after printing its address.

    Args:
        make: Function that builds the application.
        what: Name of the application, for the printed line.
        host: Network address of the page.
        port: Port of the page; 0 for a free one.
        browser: True to open the page.
        guarded: True if local pages need the token, too; see `AccessCheck`.
    """
    from marl_airhockey.play.access import AccessCheck
    from marl_airhockey.play.connections import listen, serve

    access = AccessCheck(host, guarded)
    app = make(access)
    server = listen(host, port)
    address = f"http://{_reachable(host)}:{server.getsockname()[1]}/"
    if access.token:
        address += f"?token={access.token}"
    console.print(f"{what} is at {address} (Ctrl-C stops it)", soft_wrap=True)
    if browser:
        threading.Timer(0.5, webbrowser.open, [address]).start()
    serve(app, server)


def _reachable(host: str) -> str:
    """Return the host as a part of an address that other machines can open."""
    if host == "0.0.0.0":
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
        ):
            # This sends nothing. It only selects the local address of the route.
            probe.connect(("192.0.2.1", 9))
            return str(probe.getsockname()[0])
    return f"[{host}]" if ":" in host else host
