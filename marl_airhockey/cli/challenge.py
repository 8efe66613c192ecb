"""Command ``airhockey challenge``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey import __version__
from marl_airhockey.cli.options import AsJson, Trusting, console
from marl_airhockey.cli.progress import bar
from marl_airhockey.evaluation.challenge import (
    FIELD,
    PROFILES,
    TASKS,
    play_challenge,
)
from marl_airhockey.evaluation.challenge_report import ChallengeResult
from marl_airhockey.evaluation.population import STYLES
from marl_airhockey.evaluation.suites.pieces import suite_names
from marl_airhockey.sim.core.errors import require


def challenge(
    policy: Annotated[
        str,
        typer.Argument(
            help="Name of a driver, path of a policy, folder of policies by task "
            "(juggle.npz, juggle_ur5e.npz), or zoo."
        ),
    ],
    name: Annotated[
        str | None, typer.Option(help="Name on the result card; by default POLICY.")
    ] = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the result card.")
    ] = Path("runs/challenge"),
    trust: Trusting = False,
    as_json: AsJson = False,
) -> None:
    """Play tasks in three profiles, duels and set pieces, and write a result card.

    The protocol is fixed, so that the cards of different policies can be compared.
    """
    require("matplotlib", "train")
    with bar() as progress:
        total = len(TASKS) * len(PROFILES) + len(FIELD)
        total += len(STYLES) + len(suite_names())
        task = progress.add_task("challenge", total=total, note="")

        def report(result: ChallengeResult) -> None:
            """Update the progress bar."""
            what = f"{result.name}, {result.part} in {result.profile}"
            progress.update(task, advance=1, note=f"{what} {result.score:.2f}")

        card = play_challenge(policy, name or policy, __version__, report=report)
    files = card.save(out)
    if as_json:
        console.print_json(card.to_json())
        return
    console.print(card.to_markdown(), markup=False)
    console.print("files:", *files)
