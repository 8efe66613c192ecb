"""Commands ``airhockey study new | orders | run | list | erase``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from marl_airhockey.cli.hosting import Browser, Host, Port, host_table
from marl_airhockey.cli.options import console
from marl_airhockey.cli.progress import waiting
from marl_airhockey.sim.core.errors import require

study = typer.Typer(
    help="Run studies in which participants play opponents in a planned order.",
    no_args_is_help=True,
)
File = Annotated[Path, typer.Argument(help="Plan of the study, a TOML file.")]
Folder = Annotated[
    Path, typer.Option("--out", help="Folder of the recordings and event logs.")
]


@study.command()
def new(file: File) -> None:
    """Write an example of a plan, which you can change."""
    from marl_airhockey.play.study.plan import EXAMPLE

    try:
        with file.open("x") as target:
            target.write(EXAMPLE.read_text())
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from error
    console.print(
        f"wrote {file}; airhockey study orders {file} shows the order of opponents"
    )


@study.command()
def orders(
    file: File,
    participants: Annotated[
        int, typer.Option(help="Number of participants.", min=1)
    ] = 12,
) -> None:
    """Print the order in which participants play the opponents of a plan."""
    require("starlette", "play")
    from marl_airhockey.play.study.opponents import open_match
    from marl_airhockey.play.study.plan_file import load_plan

    plan = load_plan(file)
    open_match(plan).close()
    table = Table("participant")
    for k in range(plan.blocks):
        table.add_column(f"block {k + 1}", overflow="fold")
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
    """Serve the page of a study, for one participant after the other."""
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.play.server import application
    from marl_airhockey.play.study.archive import claim_folder
    from marl_airhockey.play.study.plan_file import load_plan
    from marl_airhockey.play.study.study import open_study

    plan = load_plan(file)
    claim_folder(out, file)
    with waiting("preparing the table (the first time takes longer)"):
        session = open_study(plan, out)
    host_table(
        lambda access: application(session, access), plan.title, host, port, browser
    )
    if session.failure is not None:
        raise session.failure


@study.command("list")
def list_participants(
    folder: Annotated[Path, typer.Argument(help="Folder of the study.")],
) -> None:
    """List the participants with number, code, games, answered blocks and state."""
    from marl_airhockey.play.study.archive import diaries

    table = Table("number", "code", "began", "games", "blocks answered", "state")
    for diary in diaries(folder):
        rows = diary.rows
        if rows[0]["role"] != "participant":
            continue
        games = [row for row in rows if row["kind"] == "game" and not row["practice"]]
        blocks = {row["block"] for row in rows if row["kind"] == "answer"}
        ends = [row["reason"] for row in rows if row["kind"] == "end"]
        table.add_row(
            str(diary.number),
            diary.code,
            rows[0]["at"][:16],
            str(len(games)),
            str(len(blocks)),
            ends[0] if ends else "not ended",
        )
    console.print(table)


@study.command()
def erase(
    folder: Annotated[Path, typer.Argument(help="Folder of the study.")],
    code: Annotated[
        str, typer.Argument(help="Code of the participant, which the page showed.")
    ],
) -> None:
    """Erase all data of a participant."""
    from marl_airhockey.play.study.archive import erase as delete

    console.print(f"erased {delete(folder, code)} files of {code}")
    console.print(
        "reports in other folders may still contain this participant; write them again"
    )
