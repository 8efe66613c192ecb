"""What is missing, and how to get it."""

from __future__ import annotations

import importlib.util


def need(module: str, extra: str) -> None:
    """Check that a module of an optional extra is there.

    Raises:
        RuntimeError: it is not; the message is the line to type.
    """
    if importlib.util.find_spec(module) is None:
        raise RuntimeError(
            f"{module} is not installed: pip install 'marl_airhockey[{extra}]'"
        )
