"""Priority: raised scheduling priority for processes with deadlines."""

from __future__ import annotations

import contextlib
import os

FIRST = -20
"""Niceness of a process with deadlines"""


def raise_priority() -> None:
    """Ask the operating system to schedule this process first.

    Without the permission for it, and on Windows, the process keeps its priority, and a
    busy machine may delay it.
    """
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(FIRST - os.nice(0))
