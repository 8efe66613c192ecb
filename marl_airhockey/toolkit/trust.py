"""Trust: files that hold pickled Python are opened after a yes alone.

Whoever unpickles a file runs what its author wrote into it. The zips of
stable-baselines3 are such files; .npz and .onnx files hold numbers.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import ClassVar


class Trust:
    """Answer of this process to the question whether pickled code may run."""

    answer: bool | None = None
    """True: yes to all files; False: no to all; None: ask at a terminal, else no"""
    granted: ClassVar[set[Path]] = set()
    """Files that got a yes at a terminal, so that none is asked about twice"""


def require_trust(
    path: Path, given: bool | None = None, code: str = "pickled Python"
) -> None:
    """Ask, unless it is known, whether the code in a file may run.

    Args:
        path: of the file.
        given: the answer for this file, if it is known.
        code: what it is.

    Raises:
        ValueError: no; nothing of the file has run.
    """
    answer = Trust.answer if given is None else given
    if answer is None and path in Trust.granted:
        return
    if answer is None and sys.stdin.isatty() and sys.stderr.isatty():
        print(
            f"{path} holds {code}, which runs when it is loaded. Do you trust "
            "where it comes from? [y/N] ",
            end="",
            file=sys.stderr,
            flush=True,
        )
        answer = sys.stdin.readline().strip().lower() in ("y", "yes")
        if answer:
            Trust.granted.add(path)
    if not answer:
        raise ValueError(
            f"{path}: it holds {code}, which loading would run; say --trust, or from "
            "Python load_policy(path, trust=True), if you trust where it comes from"
        )
