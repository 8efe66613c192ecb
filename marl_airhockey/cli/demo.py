"""Command ``airhockey demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.cli.evaluate import result_table
from marl_airhockey.cli.options import console, measure_of
from marl_airhockey.cli.progress import bar
from marl_airhockey.sim.core.errors import require


def demo(
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the run and the report.")
    ] = Path("runs/demo"),
    scenario: Annotated[
        str, typer.Option(help="Name of the task to learn.")
    ] = "juggle",
    steps: Annotated[
        int | None,
        typer.Option(
            help="Number of steps, summed over all worlds; by default as in the "
            "preset, at most 2 million."
        ),
    ] = None,
) -> None:
    """Train a policy to juggle, evaluate it, and write a report with a video."""
    require("torch", "train")
    from marl_airhockey.learn.demo import run_demo

    with bar() as progress:
        task = progress.add_task(f"learning to {scenario}", total=None, note="")

        def report(done: int, total: int, row: dict[str, float]) -> None:
            """Show the progress of training."""
            name = measure_of(row)
            note = f"{name} {row[name]:.2f}" if row else ""
            progress.update(task, completed=done, total=total, note=note)

        results, files = run_demo(scenario, out, steps, report)
    console.print(result_table(results))
    for what, path in files.items():
        console.print(f"{what:>16}: {path}", soft_wrap=True)
    console.print(
        "\ntry next:\n"
        f"  airhockey watch {out / 'run'} --scenario {scenario}\n"
        "  airhockey train hit_goal && airhockey evaluate runs/hit_goal-0 -s hit_goal\n"
        "  airhockey list"
    )
