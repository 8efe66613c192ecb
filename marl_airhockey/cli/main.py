"""Entry of the command line ``airhockey``; each module holds some commands."""

from __future__ import annotations

import sys
import traceback
from typing import Annotated

import typer

from marl_airhockey import __version__
from marl_airhockey.cli import (
    bench,
    calibrate,
    calibrate_arm,
    calibrate_delay,
    challenge,
    crossplay,
    data,
    evaluate,
    lab,
    league,
    listing,
    new,
    play,
    study,
    teleop,
    train,
    transfer,
    trials,
    warm,
    watch,
)
from marl_airhockey.cli.options import app
from marl_airhockey.plugins import author_files


def _tell_version(given: bool) -> None:
    if given:
        print(f"marl_airhockey {__version__}")
        raise typer.Exit


# Importing these modules adds their commands to the application.
__all__ = [
    "bench",
    "challenge",
    "crossplay",
    "evaluate",
    "listing",
    "main",
    "new",
    "train",
    "trials",
    "warm",
    "watch",
]
app.command()(league.league)
app.command()(play.play)
app.command()(teleop.teleop)
app.command()(transfer.transfer)
app.command()(transfer.fit)
app.add_typer(data.data, name="data")
app.add_typer(study.study, name="study")
calibrate.calibrate.command()(calibrate_delay.delay)
calibrate.calibrate.command()(calibrate_arm.arm)
app.add_typer(calibrate.calibrate, name="calibrate")
app.add_typer(lab.lab, name="lab")


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Print the version.",
            callback=_tell_version,
            is_eager=True,
        ),
    ] = False,
) -> None:
    """Air hockey for robot learning and multi-agent RL."""


def main() -> None:
    """Run the command line; bad input gives one line and exit status 1."""
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"error: {error}{_place(error)}", file=sys.stderr)
        sys.exit(1)


def _place(error: BaseException) -> str:
    """Return the line of an author's own file that an error comes from, if any."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.filename in author_files]
    return f" ({own[-1].filename}, line {own[-1].lineno})" if own else ""


if __name__ == "__main__":
    main()
