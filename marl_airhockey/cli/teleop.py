"""Command ``airhockey teleop``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from marl_airhockey.cli import hosting
from marl_airhockey.cli.environment import TableOptions, in_environment
from marl_airhockey.cli.play import seat_drivers
from marl_airhockey.cli.progress import waiting
from marl_airhockey.registry import REAL
from marl_airhockey.sim.core.errors import require


@in_environment
def teleop(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")],
    environment: TableOptions,
    by: Annotated[
        Literal["mouse", "shadow"],
        typer.Option(
            help="Input device: mouse (the pointer on the page), or shadow (a hand "
            "under its own camera)."
        ),
    ] = "mouse",
    hand: Annotated[
        Path | None,
        typer.Option(
            help="File of the hand's camera from airhockey calibrate --hand, for --by "
            "shadow."
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the recordings.")
    ] = Path("recordings"),
    film: Annotated[
        bool, typer.Option(help="Record the video of the table's camera.")
    ] = True,
    opponent: Annotated[
        str | None,
        typer.Option(
            help="Driver of all other seats; by default a fitting policy of the zoo, "
            "else allround."
        ),
    ] = None,
    host: hosting.Host = "127.0.0.1",
    port: hosting.Port = 8480,
    browser: hosting.Browser = True,
) -> None:
    """Teleoperate the paddle of a real or simulated table, and record it.

    The page shows the live video of a real table. With --by shadow, the arm of a real
    table follows the hand. On a simulated table the hand itself is the paddle. --lab
    uses the devices of the virtual lab.
    """
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.live_match import LiveMatch
    from marl_airhockey.play.match_drivers import PERSON
    from marl_airhockey.play.real_match import RealMatch

    real = environment.backend == REAL
    if by == "mouse" and hand is not None:
        raise ValueError("--hand needs --by shadow")
    own = environment
    if not real:  # With a simulated table, the lab provides only the hand.
        own = replace(environment, lab=False)
    with (
        own.table(own.keywords) as table,
        hand_file(by == "shadow", hand, environment.lab) as path,
    ):
        match = (RealMatch if real else LiveMatch)(scenario, {}, table)
        leader = (
            f"shadow:rig={path},prescribe={str(not real).lower()}" if path else PERSON
        )
        seat_drivers(match, opponent, {"paddle_0": leader})
        with waiting("preparing the table (the first time takes longer)"):
            match.warm_up()
        hosting.host_match(match, out, host, port, browser, film)


@contextmanager
def hand_file(wanted: bool, hand: Path | None, lab: bool) -> Iterator[Path | None]:
    """Yield the rig file of a hand's camera, while the lab runs; None without a hand.

    Args:
        wanted: True if a hand moves the paddle.
        hand: Rig file of the hand's camera, if it was given.
        lab: True for the hand of the virtual lab.

    Raises:
        ValueError: Neither a file nor the lab was given.
        RuntimeError: The lab does not start.
    """
    if not wanted or hand is not None:
        yield hand if wanted else None
        return
    if not lab:
        raise ValueError("--by shadow needs a camera; add --hand FILE or --lab")
    from marl_airhockey.hardware.calibration.lab_rig import hand_rig

    with waiting("opening the lab (the first time takes longer)"):
        opened = hand_rig()
        path = opened.__enter__()
    try:
        yield path
    finally:
        opened.__exit__(None, None, None)
