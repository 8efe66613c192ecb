"""Pages that a command serves: their options, addresses and devices."""

from __future__ import annotations

import contextlib
import socket
import threading
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marl_airhockey.cli.options import console
from marl_airhockey.sim.core.errors import require

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from marl_airhockey.play.access import AccessCheck
    from marl_airhockey.play.game_menu import GameMenu
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.plant import Plant

POLL = 0.5
"""Time between two requests for the faults of the virtual lab, s."""
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


def host_match(
    match: LiveMatch,
    record: Path | None,
    host: str,
    port: int,
    browser: bool,
    film: bool = False,
    keep: int | None = None,
    menu: GameMenu | None = None,
    tournament: bool = False,
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
        menu: Games among which players choose; None for the match only.
        tournament: True to host a tournament between the people at the pages.
    """
    from marl_airhockey.play.open_table import GOAL_STOP, open_table
    from marl_airhockey.play.real_match import RealMatch
    from marl_airhockey.play.recorder import Recorder
    from marl_airhockey.play.seats import Seats
    from marl_airhockey.play.server import application
    from marl_airhockey.play.session import Session
    from marl_airhockey.play.tournament_table import TournamentTable

    filmed = match.backend.camera if film and isinstance(match, RealMatch) else None
    recorder = Recorder(record, filmed, keep) if record else None
    with contextlib.ExitStack() as stack:
        plant = None
        if isinstance(match, RealMatch):
            plant = stack.enter_context(lab_plant(match.backend.rig.operator))
        if tournament:
            session = Session(TournamentTable(Seats(match), recorder))
        else:
            session = open_table(match, recorder, plant, menu)
        if not isinstance(match, RealMatch):
            match.goal_stop = GOAL_STOP
        if match.keywords.get("backend") == "robosuite":
            from marl_airhockey.play.scene_view import SceneView

            scene = stack.enter_context(contextlib.closing(SceneView(match)))
            session.host.scene = scene
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
    from marl_airhockey.play.plant import Plant

    kind, _, port = operator.partition(":")
    if kind != "lab":
        yield Plant()
        return
    client = LabClient(int(port))

    def switch(name: str, on: bool) -> None:
        with contextlib.suppress(RuntimeError):
            client.ask("fault", name=name, on=on)

    active: list[str] = []
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(POLL):
            with contextlib.suppress(RuntimeError, OSError):
                active[:] = client.ask("faults")["on"]

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield Plant(FAULTS, switch, lambda: active)
    finally:
        ended.set()
        watcher.join()
        client.close()


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
    from marl_airhockey.play.invitation import code_of, in_terminal

    access = AccessCheck(host, guarded)
    server = listen(host, port)
    access.link = f"http://{_reachable(host)}:{server.getsockname()[1]}/"
    if access.token:
        access.link += f"?token={access.token}"
    app = make(access)
    console.print(f"{what} is at {access.link} (Ctrl-C stops it)", soft_wrap=True)
    if not access.local:
        code = in_terminal(code_of(access.link))
        console.print(code, markup=False, highlight=False, style="white on black")
    if browser:
        threading.Timer(0.5, webbrowser.open, [access.link]).start()
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
