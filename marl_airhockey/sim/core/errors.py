"""Error messages about missing packages and unknown names."""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Iterable

MOST = 8
"""Largest number of known names that a message lists."""
LIKE = 0.7
"""Similarity from which a name counts as a misspelling of another one."""


class UnknownKeywordError(TypeError, ValueError):
    """Error for an unknown keyword: a TypeError, as in Python, and a ValueError."""


def unknown_keyword(name: str, known: Iterable[object]) -> str:
    """Return an error message that contains Python's own wording."""
    rest = unknown_name("keyword", name, known)
    return f"unexpected keyword argument {name!r}: {rest}"


def require(module: str, extra: str) -> None:
    """Check that a module of an optional extra is installed.

    Raises:
        RuntimeError: The module is not installed. The message contains the command
            that installs it.
    """
    try:
        found = importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:  # The package of the module is missing.
        found = False
    if not found:
        raise RuntimeError(
            f"{module} is not installed: pip install 'marl_airhockey[{extra}]', or "
            f"'.[{extra}]' in a clone"
        )


def unknown_name(what: str, name: object, known: Iterable[object]) -> str:
    """Return an error message with an unknown name and the known names.

    Of more than `MOST` known names, the message contains the one that the user probably
    meant, or else the most similar ones.
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
