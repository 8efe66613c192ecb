"""Compiler: numpy functions traced once and compiled over worlds; threads."""

from __future__ import annotations

import contextlib
from pathlib import Path


def _drop_stale_code() -> None:
    """Delete compiled functions that are older than the newest source of the package.

    numba checks only the file of a function itself, so that one which calls functions
    of other files would keep running their old code after an edit.
    """
    package = Path(__file__).parents[1]
    newest = max(path.stat().st_mtime for path in package.rglob("*.py"))
    for compiled in package.rglob("*.nb[ic]"):
        # Another process may delete them at the same time; without write permission,
        # numba keeps them elsewhere.
        with contextlib.suppress(OSError):
            if compiled.stat().st_mtime < newest:
                compiled.unlink()


_drop_stale_code()
