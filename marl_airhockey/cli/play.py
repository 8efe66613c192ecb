"""The command ``airhockey play``: a table in the browser."""

from __future__ import annotations

import contextlib
import socket
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marl_airhockey.cli.options import (
    AsJson,
    Backend,
    Options,
    Profile,
    console,
    settings,
)
from marl_airhockey.core.errors import require
from marl_airhockey.world.build import Keywords

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from marl_airhockey.play.server import Door

Host = Annotated[str, typer.Option(help="Address to listen at; others need the token.")]
Port = Annotated[int, typer.Option(help="0 for a free one.", min=0, max=65535)]
Browser = Annotated[bool, typer.Option(help="Open the page.")]


def play(
    scenario: Annotated[str, typer.Argument(help="What is played.")],
    opponent: Annotated[
        str | None,
        typer.Option(help="Who sits at all other seats; of the zoo if it has one."),
    ] = None,
    seat: Annotated[
        list[str] | None,
        typer.Option(help="Who sits at one seat, AGENT=NAME; person for people."),
    ] = None,
    backend: Backend = "pymunk",
    profile: Profile = "ideal",
    option: Options = None,
    reaction: Annotated[
        float,
        typer.Option(help="ms by which programs act late.", min=0.0, max=300.0),
    ] = 0.0,
    noise: Annotated[
        float,
        typer.Option(
            help="Noise on what programs ask, of top speed.", min=0.0, max=1.0
        ),
    ] = 0.0,
    pace: Annotated[
        float,
        typer.Option(
            help="Largest speed of programs, of top speed.", min=0.05, max=1.0
        ),
    ] = 1.0,
    record: Annotated[
        Path | None, typer.Option(help="Write every episode into this folder.")
    ] = None,
    host: Host = "127.0.0.1",
    port: Port = 8480,
    browser: Browser = True,
) -> None:
    """Play against a policy, a script or each other in the browser."""
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.handicap import Fairness
    from marl_airhockey.play.live_match import PERSON, Court
    from marl_airhockey.play.recorder import Recorder
    from marl_airhockey.play.server import application
    from marl_airhockey.play.session import Session

    keywords: Keywords = {
        "backend": backend,
        "profile": profile,
        "options": settings(option),
    }
    fairness = Fairness(reaction / 1000.0, noise, pace)
    court = Court(scenario, {}, keywords, fairness)
    rest = opponent or next(iter(court.house), "allround")
    chosen = {str(k): str(v) for k, v in settings(seat).items()}
    for i in range(len(court.who)):
        agent = f"paddle_{i}"
        court.seat(i, chosen.pop(agent, PERSON if i == 0 else rest))
    if chosen:
        raise ValueError(f"--seat: {scenario} has no {', '.join(chosen)}")
    with console.status("preparing the table (longer when it is the first time)"):
        court.rehearse()
    session = Session(court, Recorder(record) if record else None)
    host_table(lambda door: application(session, door), scenario, host, port, browser)
    if session.failure is not None:
        raise session.failure


def show(recording: Path, host: str, port: int, browser: bool) -> None:
    """Show a recording in the browser until interrupted."""
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.server import replay

    name = recording.name
    host_table(lambda door: replay(recording, door), name, host, port, browser)


def report(
    folder: Annotated[Path, typer.Argument(help="Of recordings.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the report; the recordings' own.")
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", "-s", help="Of this one alone.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Sum recordings up: results, reactions, shots, limits; and a study's answers."""
    require("matplotlib", "train")
    from marl_airhockey.play.report import report as sum_up
    from marl_airhockey.study.answers import read_answers

    found, asked = sum_up(folder, scenario), read_answers(folder)
    files = found.save(out or folder)
    if asked.participants:
        files += asked.save(out or folder)
    if as_json:
        console.print_json(files[0].read_text())
        return
    for path in files:
        if path.suffix == ".md":
            console.print(path.read_text(), markup=False, soft_wrap=True)
    console.print("files:", *files, soft_wrap=True)


def host_table(
    make: Callable[[Door], Starlette], what: str, host: str, port: int, browser: bool
) -> None:
    """Serve an application, say where, and open it."""
    from marl_airhockey.play.server import Door, listen, serve

    door = Door(host)
    app = make(door)
    server = listen(host, port)
    address = f"http://{_shown(host)}:{server.getsockname()[1]}/"
    if door.token:
        address += f"?token={door.token}"
    console.print(f"{what} is at {address} (Ctrl-C ends it)", soft_wrap=True)
    if browser:
        threading.Timer(0.5, webbrowser.open, [address]).start()
    serve(app, server)


def _shown(host: str) -> str:
    """A host as others can open it."""
    if host == "0.0.0.0":
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
        ):
            # Sends nothing: it only asks which of our addresses would be used.
            probe.connect(("192.0.2.1", 9))
            return str(probe.getsockname()[0])
    return f"[{host}]" if ":" in host else host
