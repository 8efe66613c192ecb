"""What is missing, and how to get it."""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Iterable


def require(module: str, extra: str) -> None:
    """Check that a module of an optional extra is there.

    Raises:
        RuntimeError: it is not; the message is the line to type.
    """
    if importlib.util.find_spec(module) is None:
        raise RuntimeError(
            f"{module} is not installed: pip install 'marl_airhockey[{extra}]'"
        )


def unknown_name(what: str, name: object, known: Iterable[object]) -> str:
    """A message that names what is unknown and lists what exists, closest first."""
    names = [str(n) for n in known]
    ratio = {n: difflib.SequenceMatcher(None, str(name), n).ratio() for n in names}
    ranked = sorted(names, key=lambda n: (-ratio[n], n))
    return f"unknown {what} {name!r}; there are: {', '.join(ranked)}"
