"""Command ``airhockey teleop``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from marl_airhockey.cli import play as cli_play
from marl_airhockey.cli.environment import TableOptions, in_environment
from marl_airhockey.cli.progress import waiting
from marl_airhockey.registry import REAL
from marl_airhockey.sim.core.errors import require


@in_environment
def teleop(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")],
    environment: TableOptions,
    by: Annotated[
        Literal["mouse", "shadow"],
        typer.Option(help="The page's pointer, or a hand under a camera of its own."),
    ] = "mouse",
    hand: Annotated[
        Path | None,
        typer.Option(help="Of --by shadow: file of that camera, calibrate --hand."),
    ] = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the recordings.")
    ] = Path("recordings"),
    film: Annotated[
        bool, typer.Option(help="Keep the camera's pictures beside them.")
    ] = True,
    opponent: Annotated[
        str | None, typer.Option(help="Who sits at all other seats.")
    ] = None,
    host: cli_play.Host = "127.0.0.1",
    port: cli_play.Port = 8480,
    browser: cli_play.Browser = True,
) -> None:
    """Lead the paddle yourself, on a real table by its live video, and record it.

    On a real table the hand of --by shadow leads the arm; at a simulated seat it is the
    paddle. --lab takes the virtual lab's devices.
    """
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.match_drivers import PERSON
    from marl_airhockey.play.real_match import RealMatch

    real = environment.backend == REAL
    if by == "mouse" and hand is not None:
        raise ValueError("--hand: add --by shadow")
    own = environment
    if not real:  # Of a simulated table the lab has the hand alone.
        own = replace(environment, lab=False)
    with (
        own.table(own.keywords) as table,
        hand_file(by == "shadow", hand, environment.lab) as path,
    ):
        match = (RealMatch if real else LiveMatch)(scenario, {}, table)
        leader = (
            f"shadow:rig={path},prescribe={str(not real).lower()}" if path else PERSON
        )
        cli_play.seat_drivers(match, opponent, {"paddle_0": leader})
        with waiting("preparing the table (longer when it is the first time)"):
            match.warm_up()
        cli_play.host_match(match, out, host, port, browser, film)


@contextmanager
def hand_file(wanted: bool, hand: Path | None, lab: bool) -> Iterator[Path | None]:
    """Give the file of the rig of a hand, while its lab runs; None if none is wanted.

    Args:
        wanted: whether a hand leads.
        hand: its file.
        lab: whether it is the virtual lab's.

    Raises:
        ValueError: neither a file nor a lab.
        RuntimeError: the lab does not start.
    """
    if not wanted or hand is not None:
        yield hand if wanted else None
        return
    if not lab:
        raise ValueError("--by shadow: which camera? --hand FILE, or --lab")
    from marl_airhockey.hardware.calibration.lab_rig import hand_rig

    with waiting("opening the lab (longer when it is the first time)"):
        opened = hand_rig()
        path = opened.__enter__()
    try:
        yield path
    finally:
        opened.__exit__(None, None, None)
