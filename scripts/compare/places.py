"""Installations that are compared: this checkout, another one, or a wheel."""

from __future__ import annotations

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
"""Folder of this checkout."""


def started(place: Path, cache: str | None = None) -> tuple[str, dict[str, str]]:
    """Return the interpreter of an installation, and the environment of its processes.

    Args:
        place: Folder of a checkout, or the interpreter of an environment.
        cache: Folder of compiled code; None for that of the user.
    """
    known = {**os.environ}
    if cache is not None:
        known["MARL_AIRHOCKEY_CACHE"] = cache
    if place.is_file():
        return str(place), known
    return sys.executable, {**known, "PYTHONPATH": str(place)}
