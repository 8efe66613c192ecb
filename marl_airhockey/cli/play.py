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
from marl_airhockey.play.handicap import BOUNDS, PRESETS, USUAL, Handicap
from marl_airhockey.registry import REAL, make_driver
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.world.keywords import Keywords

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from marl_airhockey.play.access import AccessCheck
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.open_table import Plant

Host = Annotated[str, typer.Option(help="Address to listen at; others need the token.")]
Port = Annotated[int, typer.Option(help="0 for a free one.", min=0, max=65535)]
Browser = Annotated[bool, typer.Option(help="Open the page.")]
Reaction = Annotated[
    float | None,
    typer.Option(
        help="Latency of drivers that are no people, s.",
        min=BOUNDS["reaction"][0],
        max=BOUNDS["reaction"][1],
    ),
]
Noise = Annotated[
    float | None,
    typer.Option(
        help="Noise on their actions, as a fraction of top speed.",
        min=BOUNDS["noise"][0],
        max=BOUNDS["noise"][1],
    ),
]
Pace = Annotated[
    float | None,
    typer.Option(
        help="Largest of their speeds, as a fraction of top speed.",
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
        typer.Option(help="Who sits at all other seats; of the zoo if it has one."),
    ] = None,
    reaction: Reaction = None,
    noise: Noise = None,
    pace: Pace = None,
    record: Annotated[
        Path | None, typer.Option(help="Write every episode into this folder.")
    ] = None,
    keep: Annotated[
        int,
        typer.Option(help="Most recordings; then the oldest of this table go.", min=1),
    ] = 1000,
    host: Host = "127.0.0.1",
    port: Port = 8480,
    browser: Browser = True,
) -> None:
    """Play against a policy, a script or each other in the browser.

    With --driver AGENT=person people take that seat.
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
        if not given and kind is LiveMatch and match.has_opponents:
            match.set_handicap(PRESETS[USUAL])
        with waiting("preparing the table (longer when it is the first time)"):
            match.warm_up()
        if record:
            console.print(f"recordings: {record}, of this table the newest {keep}")
        host_match(match, record, host, port, browser, keep=keep)


def _as_trained(scenario: str, names: set[str | None], given: Keywords) -> Keywords:
    """Fill in what is not given from what the policies that play were trained in."""
    from marl_airhockey.play.match_drivers import PERSON

    chosen = sorted(str(name) for name in names if name not in (None, PERSON))
    players = {name: make_driver(name) for name in chosen}
    _, keywords, _ = as_trained_unless_given(players, scenario, given)
    keywords.pop("drivers", None)  # Every seat of a match gets its driver there.
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
    """Serve a match until interrupted; of one in the virtual lab, with its faults.

    Args:
        match: to serve.
        record: folder for its recordings; None for none.
        host: see `host_table`.
        port: see `host_table`.
        browser: see `host_table`.
        film: whether to keep a real table's pictures beside the recordings.
        keep: most recordings; None for all.
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
        # The virtual lab is the plant that has faults.
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
    """Give the faults of the virtual lab that a rig's operator names; none elsewhere.

    Args:
        operator: see `rig.Rig.operator`.
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
    """Give each seat to its driver: a person at the first, opponents elsewhere.

    Args:
        match: before its start.
        opponent: of all seats that are not chosen; None for a policy of the zoo that
            fits, or else allround.
        seats: chosen drivers, by agent.
    """
    from marl_airhockey.play.match_drivers import PERSON

    rest = opponent or next(iter(match.drivers.fitting_policies), "allround")
    chosen = {str(agent): str(name) for agent, name in seats.items()}
    for i in range(len(match.seats)):
        agent = f"paddle_{i}"
        match.set_driver(i, chosen.pop(agent, PERSON if i == 0 else rest))
    if chosen:
        scenario = match.world.scenario.name
        raise ValueError(f"--driver: {scenario} has no {', '.join(chosen)}")


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
        make: builds the application.
        what: is served, for the printed line.
        host: address to listen at.
        port: to listen at; 0 for a free one.
        browser: True to open the page.
        guarded: See `AccessCheck`.
    """
    from marl_airhockey.play.access import AccessCheck
    from marl_airhockey.play.connections import listen, serve

    access = AccessCheck(host, guarded)
    app = make(access)
    server = listen(host, port)
    address = f"http://{_reachable(host)}:{server.getsockname()[1]}/"
    if access.token:
        address += f"?token={access.token}"
    console.print(f"{what} is at {address} (Ctrl-C ends it)", soft_wrap=True)
    if browser:
        threading.Timer(0.5, webbrowser.open, [address]).start()
    serve(app, server)


def _reachable(host: str) -> str:
    """Return a host as pages on other machines can open it."""
    if host == "0.0.0.0":
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
        ):
            # Sends nothing: it only selects which of our addresses would be used.
            probe.connect(("192.0.2.1", 9))
            return str(probe.getsockname()[0])
    return f"[{host}]" if ":" in host else host
