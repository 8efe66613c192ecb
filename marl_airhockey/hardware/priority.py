"""Raised scheduling priority for processes with deadlines."""

from __future__ import annotations

import contextlib
import os

FIRST = -20
"""Niceness of a process with deadlines."""


def raise_priority() -> None:
    """Request the highest scheduling priority for this process.

    Without the permission, and on Windows, the priority does not change, and a busy
    machine may delay the process.
    """
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(FIRST - os.nice(0))
