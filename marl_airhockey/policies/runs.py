"""Runs of training: the files of their policies, and their format."""

from __future__ import annotations

from pathlib import Path

RUN_FORMAT = 2
"""Format of a run's folder, in its ``config.toml`` and in the card of its zips.

Raised whenever classes that a run pickles, or settings that it names, move: runs of
another format are refused.
"""
KINDS = ("npz", "onnx", "zip")
"""File name extensions of the policies that engines write, the safe one first."""


def policies_of(run: Path) -> list[Path]:
    """Return the possible paths of a run's policies, the best choice first."""
    return [run / f"{name}.{kind}" for kind in KINDS for name in ("best", "last")]


def check_run_format(source: Path, found: int) -> None:
    """Refuse a run of another format than `RUN_FORMAT`.

    Raises:
        ValueError: Another format.
    """
    if found != RUN_FORMAT:
        raise ValueError(
            f"{source}: this run was begun by another version of marl_airhockey (run "
            f"format {found}, this version reads {RUN_FORMAT}); train it again "
            "in another folder"
        )
