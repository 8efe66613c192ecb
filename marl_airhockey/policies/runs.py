"""Run folders of training: their format and the files of their policies."""

from __future__ import annotations

from pathlib import Path

RUN_FORMAT = 2
"""Format of a run folder, stored in its ``config.toml`` and in the card of its zips.

It increases whenever pickled classes or named settings move. Runs of another format
raise an error.
"""
KINDS = ("npz", "onnx", "zip")
"""File name extensions of the policies that engines write, the safe one first."""


def policies_of(run: Path) -> list[Path]:
    """Return the possible paths of a run's policies, the best choice first."""
    return [run / f"{name}.{kind}" for kind in KINDS for name in ("best", "last")]


def check_run_format(source: Path, found: int) -> None:
    """Check that a run has the format `RUN_FORMAT`.

    Raises:
        ValueError: It has another format.
    """
    if found != RUN_FORMAT:
        raise ValueError(
            f"{source}: this run was begun by another version of marl_airhockey (run "
            f"format {found}, this version reads {RUN_FORMAT}); train it again "
            "in another folder"
        )
