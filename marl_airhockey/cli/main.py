"""Entry point of the command line ``airhockey``; each module defines some commands."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from typing import Annotated

import typer

from marl_airhockey import __version__
from marl_airhockey.cli import (
    bench,
    challenge,
    crossplay,
    demo,
    evaluate,
    export,
    export_code,
    fit,
    lab,
    league,
    listing,
    new,
    play,
    precompile,
    study,
    suite,
    teleop,
    train,
    transfer,
    trials,
    ur_emulator,
    verify,
    watch,
)
from marl_airhockey.cli.calibrate import arm, camera, delay
from marl_airhockey.cli.data import files, recordings, sets
from marl_airhockey.plugins import author_files


def _tell_version(given: bool) -> None:
    if given:
        print(f"marl_airhockey {__version__}")
        raise typer.Exit


app = typer.Typer(
    help="Air hockey for robot learning and multi-agent RL.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
COMMANDS: dict[str, Callable[..., None]] = {
    "list": listing.list_scenarios,
    "train": train.train,
    "evaluate": evaluate.evaluate_driver,
    "watch": watch.watch,
    "play": play.play,
    "league": league.play_league,
    "crossplay": crossplay.crossplay,
    "challenge": challenge.challenge,
    "export": export.export,
    "export-code": export_code.export_code,
    "demo": demo.demo,
    "transfer": transfer.transfer,
    "fit": fit.fit,
    "fit-table": fit.fit_table,
    "trials": trials.trials,
    "teleop": teleop.teleop,
    "bench": bench.bench_environments,
    "precompile": precompile.precompile,
    "verify": verify.verify,
    "new": new.new,
}
"""Function of each command, by name."""
GROUPS = {
    "data": recordings.data,
    "study": study.study,
    "suite": suite.suite,
    "calibrate": camera.calibrate,
    "lab": lab.lab,
    "ur-emulator": ur_emulator.ur_emulator,
}
"""Groups of commands, by name."""
for name, function in COMMANDS.items():
    app.command(name)(function)
for function in (delay.delay, arm.arm):
    camera.calibrate.command()(function)
for function in files.COMMANDS:
    recordings.data.command()(function)
recordings.data.command("import")(files.import_dataset)
recordings.data.command("get")(sets.get)
recordings.data.command("list")(sets.list_datasets)
for name, group in GROUPS.items():
    app.add_typer(group, name=name)


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Print the version and exit.",
            callback=_tell_version,
            is_eager=True,
        ),
    ] = False,
) -> None:
    """Air hockey for robot learning and multi-agent RL."""


def main() -> None:
    """Run the command line.

    Invalid input prints one line to standard error and exits with status 1.
    """
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"error: {error}{_place(error)}", file=sys.stderr)
        sys.exit(1)


def _place(error: BaseException) -> str:
    """Return the file and line of a user's own code that raised an error, or ""."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.filename in author_files]
    return f" ({own[-1].filename}, line {own[-1].lineno})" if own else ""


if __name__ == "__main__":
    main()
