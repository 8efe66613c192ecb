"""Command ``airhockey verify``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.cli.options import console
from marl_airhockey.cli.progress import bar
from marl_airhockey.evaluation import hashes


def verify(
    only: Annotated[
        str, typer.Option(help="Part of the names of the games that are played.")
    ] = "",
    out: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="File for the hashes, by game, as JSON."),
    ] = None,
) -> None:
    """Play fixed games, and check that this machine computes the known bits.

    The command ends with status 1 if the hash of a game differs.
    """
    chosen = [game for game in hashes.games() if only in game.name]
    if not chosen:
        names = ", ".join(game.name for game in hashes.games())
        raise ValueError(f"--only {only}: no game has this in its name: {names}")
    known, found = hashes.known(), dict[str, str]()
    with bar() as progress:
        task = progress.add_task("playing", total=len(chosen), note="")
        for game in chosen:
            found[game.name] = hashes.play(game)
            progress.update(task, note=game.name, advance=1)
    for name, value in found.items():
        equal = "equal" if known.get(name) == value else "DIFFERENT"
        console.print(f"{value[:16]}  {equal:9}  {name}", highlight=False)
    if out is not None:
        out.write_text(json.dumps(found, indent=1) + "\n")
    different = [name for name, value in found.items() if known.get(name) != value]
    print(f"{len(found) - len(different)} of {len(found)} games are equal to the bit")
    if different:
        raise typer.Exit(1)
