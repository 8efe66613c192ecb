"""Files of recordings: those in a folder, and what those of one dataset share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from marl_airhockey.core.recording import SUFFIX, read_head

ALIKE = ("scenario", "options", "observe", "control_dt", "profile", "players")
"""Keys of heads that recordings of one dataset must share"""


def recordings_in(paths: Sequence[Path]) -> list[Path]:
    """Return the files among some paths and in the folders among them.

    Raises:
        ValueError: a path that is not there, or no recording at all.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise ValueError(f"{path}: there is no such file or folder")
        files += sorted(path.rglob(f"*{SUFFIX}")) if path.is_dir() else [path]
    if not files:
        raise ValueError(f"{paths[0]}: there are no recordings (*{SUFFIX}) in it")
    return files


def shared_head(files: Sequence[Path]) -> dict[str, Any]:
    """Return what the heads of recordings share.

    Raises:
        ValueError: files that differ in what they must share, named.
    """
    heads = [read_head(path) for path in files]
    for path, head in zip(files, heads, strict=True):
        for name in ALIKE:
            if name not in head:
                raise ValueError(f"{path}: its head has no {name!r}")
            if head[name] != heads[0][name] and name != "players":
                raise ValueError(
                    f"{path}: {name} is {head[name]!r}, that of {files[0]} is "
                    f"{heads[0][name]!r}; learn from one kind at a time"
                )
    return heads[0]
