"""Command ``airhockey export``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.cli.options import Trusting, console
from marl_airhockey.sim.core.errors import require


def export(
    run: Annotated[
        Path, typer.Argument(file_okay=False, help="Folder of a training run.")
    ],
    out: Annotated[Path, typer.Option(help="File to write, .npz or .onnx.")] = Path(
        "policy.npz"
    ),
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            help="Checkpoint of the run to export; by default the last policy."
        ),
    ] = None,
    trust: Trusting = False,
) -> None:
    """Export the policy of a run to one file, with a card of its training and results.

    A .npz file needs only NumPy. A .onnx file needs the extra offline.
    """
    if not (run / "config.toml").exists():
        raise ValueError(f"{run}: this is not the folder of a training run; give one")
    require("torch", "train")
    from marl_airhockey.learn.export import export_policy

    console.print_json(json.dumps(dict(export_policy(run, out, checkpoint).card)))
    which = checkpoint or f"the last policy of {run}"
    console.print(
        f"{out}: {which}, {out.stat().st_size / 1000:.0f} kB; airhockey evaluate {run} "
        f"evaluates the best policy, and --checkpoint {run / 'best.npz'} exports it",
        soft_wrap=True,
    )
