"""Trust: code from a file runs only after a yes.

Whoever unpickles a file runs what its author wrote into it. The zips of
stable-baselines3 are such files; .npz and .onnx files hold numbers. The settings of a
run may name Python files, which run without a question if the user has trained with
exactly this code on this machine before.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import ClassVar

from marl_airhockey.sim.jit.folders import cache_folder

TRUSTED_CODE = "trusted-code.txt"
"""File in the cache folder with the SHA-256 of each Python file trained with."""


class Trust:
    """Answer of this process to the question whether pickled code may run."""

    answer: bool | None = None
    """True: yes to all files; False: no to all; None: ask at a terminal, else no"""
    granted: ClassVar[set[Path]] = set()
    """Files that got a yes at a terminal, so that there is one question for each"""


def require_trust(
    path: Path, given: bool | None = None, code: str = "pickled Python"
) -> None:
    """Ask, unless it is known, whether the code in a file may run.

    Args:
        path: Path of the file.
        given: Answer for this file, if it is known.
        code: Description of the code.

    Raises:
        ValueError: The answer is no; nothing in the file has run.
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


def trust_code(text: str) -> None:
    """Remember the Python file that a text names as trusted, with what is in it now.

    Args:
        text: ``FILE.py`` or ``FILE.py:NAME``; anything else is left alone.
    """
    digest = _digest(text)
    if digest and not is_trusted_code(text):
        with (cache_folder() / TRUSTED_CODE).open("a") as file:
            file.write(f"{digest}\n")


def is_trusted_code(text: str) -> bool:
    """Return True if a text names a Python file that `trust_code` knows, unchanged."""
    digest, known = _digest(text), cache_folder() / TRUSTED_CODE
    return bool(digest) and known.exists() and digest in known.read_text().split()


def _digest(text: str) -> str:
    """Return the SHA-256 of the Python file that a text names; "" for none."""
    path = Path(text.partition(".py")[0] + ".py")
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
