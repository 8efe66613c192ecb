"""Errors: messages about missing packages and unknown names."""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Iterable

MOST = 8
"""Largest number of known names that a message lists"""
LIKE = 0.7
"""Likeness from which one name is nearly another"""


class UnknownKeywordError(TypeError, ValueError):
    """Unknown keyword: a TypeError, as in Python, and a ValueError, as bad input is."""


def unknown_keyword(name: str, known: Iterable[object]) -> str:
    """Return an error message, which holds the words that Python itself uses."""
    rest = unknown_name("keyword", name, known)
    return f"unexpected keyword argument {name!r}: {rest}"


def require(module: str, extra: str) -> None:
    """Check that a module of an optional extra is installed.

    Raises:
        RuntimeError: it is not; the message holds the command that installs it.
    """
    if importlib.util.find_spec(module) is None:
        raise RuntimeError(
            f"{module} is not installed: pip install 'marl_airhockey[{extra}]'"
        )


def unknown_name(what: str, name: object, known: Iterable[object]) -> str:
    """Return an error message: the unknown name and those that were meant.

    Of many known names it holds the one that is nearly the same, or the closest ones.
    """
    names = [str(n) for n in known]
    ratio = {n: difflib.SequenceMatcher(None, str(name), n).ratio() for n in names}
    ranked = sorted(names, key=lambda n: (-ratio[n], n))
    message = f"unknown {what} {name!r}"
    if len(names) <= MOST:
        return f"{message}; there are: {', '.join(ranked)}"
    if ratio[ranked[0]] >= LIKE:
        return f"{message} (did you mean {ranked[0]!r}?)"
    rest = len(names) - MOST
    return f"{message}; there are: {', '.join(ranked[:MOST])} and {rest} more"
