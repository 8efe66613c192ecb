"""Trust: code in a file runs only if the user allows it.

A pickled file can contain any code, which runs when the file is loaded. The zips of
stable-baselines3 are pickled files. Files of the types .npz and .onnx contain numbers.
The settings of a run can name Python files. They run without a question if the user has
trained with exactly this code on this machine before.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import ClassVar

from marl_airhockey.sim.jit.folders import cache_folder

TRUSTED_CODE = "trusted-code.txt"
"""File in the cache folder with the SHA-256 of each Python file used in training."""


class Trust:
    """Permission to run pickled code, for this process."""

    answer: bool | None = None
    """True for all files, False for none, None to ask at a terminal."""
    granted: ClassVar[set[Path]] = set()
    """Files that the user allowed at a terminal, so that each question occurs once."""


def require_trust(
    path: Path, given: bool | None = None, code: str = "pickled Python"
) -> None:
    """Ask for permission to run the code in a file, unless it is known.

    Args:
        path: Path of the file.
        given: Permission for this file; None if it is not known.
        code: Description of the code, for messages.

    Raises:
        ValueError: There is no permission. No code in the file has run.
    """
    answer = Trust.answer if given is None else given
    if answer is None and path in Trust.granted:
        return
    if answer is None and sys.stdin.isatty() and sys.stderr.isatty():
        print(
            f"{path} contains {code}, which runs when it is loaded. Do you trust "
            "its source? [y/N] ",
            end="",
            file=sys.stderr,
            flush=True,
        )
        answer = sys.stdin.readline().strip().lower() in ("y", "yes")
        if answer:
            Trust.granted.add(path)
    if not answer:
        raise ValueError(
            f"{path}: it contains {code}, which would run; if you trust its source, "
            "use --trust, or load_policy(path, trust=True) in Python"
        )


def trust_code(text: str) -> None:
    """Mark the Python file that a text names as trusted, with its current content.

    Args:
        text: ``FILE.py`` or ``FILE.py:NAME``. Any other text has no effect.
    """
    digest = _digest(text)
    if digest and not is_trusted_code(text):
        with (cache_folder() / TRUSTED_CODE).open("a") as file:
            file.write(f"{digest}\n")


def is_trusted_code(text: str) -> bool:
    """Return True if a text names a Python file that was trusted and is unchanged."""
    digest, known = _digest(text), cache_folder() / TRUSTED_CODE
    return bool(digest) and known.exists() and digest in known.read_text().split()


def _digest(text: str) -> str:
    """Return the SHA-256 of the Python file that a text names; "" for none."""
    path = Path(text.partition(".py")[0] + ".py")
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
