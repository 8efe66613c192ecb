"""Commands ``airhockey lab`` and ``airhockey lab fault``."""

from __future__ import annotations

import contextlib
import time
from typing import Annotated

import typer

from marl_airhockey.cli import play as cli_play
from marl_airhockey.cli.environment import TableOptions
from marl_airhockey.cli.options import console
from marl_airhockey.cli.progress import waiting
from marl_airhockey.hardware.lab.faults import FAULTS
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.registry import REAL, find_backend
from marl_airhockey.sim.core.errors import require

GAME, PLAYER = "juggle", "zoo/juggle"
"""Scenario and player of the demo"""

lab = typer.Typer(help="The virtual lab: a table, a camera and a UR5e over a network.")


@lab.callback(invoke_without_command=True)
def open_lab(
    context: typer.Context,
    seed: Annotated[int, typer.Option(help="Of what its table is like.")] = 0,
    frame_rate: Annotated[
        float, typer.Option(help="Pictures a second.", min=1.0, max=60.0)
    ] = 30.0,
    plant: Annotated[
        str, typer.Option(help="Backend that moves the puck: numba, pymunk, robosuite.")
    ] = LabSetup.plant,
    demo: Annotated[
        bool, typer.Option("--demo", help="Let the learned juggler play, on a page.")
    ] = False,
    host: cli_play.Host = "127.0.0.1",
    port: cli_play.Port = 8480,
    browser: cli_play.Browser = True,
) -> None:
    """Open the lab until Ctrl+C; other commands find it with --backend real --lab.

    --host, --port and --browser are those of the demo's page.
    """
    if context.invoked_subcommand is not None:
        return
    from marl_airhockey.hardware.lab.lab import Lab, LabClient, served

    if plant == REAL:
        raise ValueError("--plant real: the lab is what stands in for a real table")
    find_backend(plant)
    running = LabClient.find()
    if running is not None:
        running.close()
        raise RuntimeError("lab: one is running already; end it first")
    with waiting("opening the lab (longer when it is the first time)"):
        opened = Lab(LabSetup(plant=plant), seed, frame_rate)
    # Ctrl+C may come as soon as the door is open, so it is caught around all of it.
    with contextlib.suppress(KeyboardInterrupt), opened, served(opened):
        if demo:
            show_demo(host, port, browser)
            return
        console.print(f"robot: {opened.host}, camera: stream:{opened.camera_port}")
        console.print(
            "play in it: airhockey evaluate zoo/juggle --backend real --lab "
            "--episodes 5\nCtrl+C ends it"
        )
        while all(opened.alive):
            time.sleep(0.5)
        raise RuntimeError("lab: one of its processes has ended")


def show_demo(host: str, port: int, browser: bool) -> None:
    """Show the learned juggler in the running lab, on a page, until interrupted."""
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.real_match import RealMatch

    environment = TableOptions(lab=True)
    with environment.table(environment.keywords) as table:
        match = RealMatch(GAME, {"paddle_0": environment.on_table(PLAYER)}, table)
        match.again = True
        cli_play.host_match(match, None, host, port, browser)


@lab.command()
def fault(
    name: Annotated[
        str | None, typer.Argument(help="Which; without one, all are listed.")
    ] = None,
    off: Annotated[bool, typer.Option("--off", help="End it.")] = False,
) -> None:
    """Let something go wrong in the running lab."""
    from marl_airhockey.hardware.lab.lab import LabClient

    if name is None:
        for known, words in FAULTS.items():
            console.print(f"{known:18} {words}")
        return
    client = LabClient.find()
    if client is None:
        raise RuntimeError("lab: none is running; start one with airhockey lab")
    client.ask("fault", name=name, on=not off)
    client.close()
    console.print(f"{name}: {'ended' if off else FAULTS[name]}")
