"""The commands ``airhockey study new | orders | run | erase``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli_common import console
from marl_airhockey.cli_play import Browser, Host, Port, host_table
from marl_airhockey.extras import need

study = typer.Typer(
    help="Studies: participants play opponents in a planned order.",
    no_args_is_help=True,
)
File = Annotated[Path, typer.Argument(help="A plan, TOML.")]
Folder = Annotated[Path, typer.Option("--out", help="What is recorded goes here.")]


@study.command()
def new(file: File) -> None:
    """Write an example of a plan, to be changed."""
    from marl_airhockey.study.plan import EXAMPLE

    try:
        with file.open("x") as target:
            target.write(EXAMPLE.read_text())
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from error
    console.print(f"wrote {file}; airhockey study orders {file} shows who meets whom")


@study.command()
def orders(
    file: File,
    participants: Annotated[int, typer.Option(help="How many.", min=1)] = 12,
) -> None:
    """Print the order in which participants meet the opponents of a plan."""
    from marl_airhockey.study.plan import load

    plan = load(file)
    table = Table("participant", *(f"block {k + 1}" for k in range(plan.blocks)))
    for number in range(participants):
        labels = [o.label for o in plan.opponents] or [plan.scenario]
        table.add_row(str(number), *(labels[k] for k in plan.sequence(number)))
    console.print(table)


@study.command()
def run(
    file: File,
    out: Folder,
    host: Host = "127.0.0.1",
    port: Port = 8480,
    browser: Browser = True,
) -> None:
    """Serve a study in the browser, one participant after the other."""
    need("starlette", "play")
    need("uvicorn", "play")
    from marl_airhockey.play.server import application
    from marl_airhockey.study.plan import load
    from marl_airhockey.study.study import Study

    plan = load(file)
    with console.status("preparing the table (longer when it is the first time)"):
        session = Study(plan, out)
    host_table(lambda door: application(session, door), plan.title, host, port, browser)
    if session.failure is not None:
        raise session.failure


@study.command()
def erase(
    folder: Annotated[Path, typer.Argument(help="Of the study.")],
    code: Annotated[str, typer.Argument(help="That the participant was shown.")],
) -> None:
    """Erase all that is kept of a participant."""
    from marl_airhockey.study.archive import erase as delete

    console.print(f"erased {delete(folder, code)} files of {code}")
