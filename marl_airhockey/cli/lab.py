"""Commands ``airhockey lab`` and ``airhockey lab fault``."""

from __future__ import annotations

import contextlib
import time
from typing import Annotated

import typer

from marl_airhockey.cli import hosting
from marl_airhockey.cli.environment import TableOptions
from marl_airhockey.cli.options import console
from marl_airhockey.cli.progress import waiting
from marl_airhockey.hardware.lab.faults import FAULTS
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.registry import REAL, find_backend
from marl_airhockey.sim.core.errors import require

GAME, PLAYER = "juggle", "zoo/juggle"
"""Scenario and policy of the demo."""

lab = typer.Typer(
    help="Run the virtual lab until Ctrl+C: an emulated table, camera and UR5e.\n\n"
    "Other commands use it with --backend real --lab. --host, --port and --browser "
    "apply to the page of --demo."
)


@lab.callback(invoke_without_command=True)
def open_lab(
    context: typer.Context,
    seed: Annotated[
        int, typer.Option(help="Seed of the sampled physics of the table.")
    ] = 0,
    frame_rate: Annotated[
        float,
        typer.Option(help="Frame rate of the camera, frames/s.", min=1.0, max=60.0),
    ] = 30.0,
    plant: Annotated[
        str,
        typer.Option(
            help="Physics engine of the emulated table: numba, pymunk or robosuite."
        ),
    ] = LabSetup.plant,
    marked: Annotated[
        bool,
        typer.Option(
            "--marked",
            help="Use a puck with a bar on it, by which the camera sees its spin.",
        ),
    ] = False,
    block: Annotated[
        bool,
        typer.Option("--block", help="Put a block on the table, for move_block."),
    ] = False,
    demo: Annotated[
        bool,
        typer.Option(
            "--demo",
            help="Show a trained policy that juggles, on a page in the browser.",
        ),
    ] = False,
    host: hosting.Host = "127.0.0.1",
    port: hosting.Port = 8480,
    browser: hosting.Browser = True,
) -> None:
    """Run the virtual lab until Ctrl+C."""
    if context.invoked_subcommand is not None:
        return
    from marl_airhockey.hardware.lab.lab import Lab, LabClient, served

    if plant == REAL:
        raise ValueError(
            "--plant real: the lab emulates a table; use numba, pymunk or robosuite"
        )
    find_backend(plant)
    running = LabClient.find()
    if running is not None:
        running.close()
        raise RuntimeError("lab: another lab is already running; stop it first")
    with waiting("opening the lab (the first time takes longer)"):
        opened = Lab(
            LabSetup(plant=plant, marked=marked, block=block), seed, frame_rate
        )
    # Ctrl+C can come as soon as the RPC server is open, so all of it is covered.
    with contextlib.suppress(KeyboardInterrupt), opened, served(opened):
        if demo:
            show_demo(host, port, browser)
            return
        console.print(f"robot: {opened.host}, camera: stream:{opened.camera_port}")
        console.print(
            "to play in it: airhockey evaluate zoo/juggle --backend real --lab "
            "--episodes 5\nCtrl+C stops the lab"
        )
        while all(opened.alive):
            time.sleep(0.5)
        raise RuntimeError("lab: one of its processes has stopped")


def show_demo(host: str, port: int, browser: bool) -> None:
    """Show the trained juggler in the running lab on a page, until interrupted."""
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.real_match import RealMatch

    environment = TableOptions(lab=True)
    with environment.table(environment.keywords) as table:
        match = RealMatch(GAME, {"paddle_0": environment.on_table(PLAYER)}, table)
        match.again = True
        hosting.host_match(match, None, host, port, browser)


@lab.command()
def fault(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Name of a fault; by default all are listed, and those that are on."
        ),
    ] = None,
    off: Annotated[
        bool, typer.Option("--off", help="Switch the fault off instead of on.")
    ] = False,
) -> None:
    """Switch a fault of the running lab on or off."""
    from marl_airhockey.hardware.lab.lab import LabClient

    client = LabClient.find()
    if name is None:
        on = client.ask("faults")["on"] if client else []
        for known, words in FAULTS.items():
            console.print(f"{known:18} {words}{' (on)' if known in on else ''}")
        if client:
            client.close()
        return
    if client is None:
        raise RuntimeError("lab: no lab is running; start one with airhockey lab")
    client.ask("fault", name=name, on=not off)
    client.close()
    console.print(f"{name}: {'ended' if off else FAULTS[name]}")
