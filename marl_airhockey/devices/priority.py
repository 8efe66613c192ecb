"""Priority: processes that must be in time are served before others."""

from __future__ import annotations

import contextlib
import os

FIRST = -20
"""Niceness of such a process"""


def raise_priority() -> None:
    """Ask the operating system to serve this process first.

    It refuses where users have no right to that; the process is then as all others,
    and a busy machine may make it late.
    """
    with contextlib.suppress(OSError):
        os.nice(FIRST - os.nice(0))
