"""Meanings of options, success and terms, read off the docstrings of a scenario."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from itertools import pairwise

from marl_airhockey.sim.contracts.scenario import Scenario

TERM = re.compile(r"^ *(\w+): (.+?)(?=\n *\w+: |\n\n|\Z)", re.MULTILINE | re.DOTALL)
"""Line of a docstring, ``name: meaning``, and those that it goes on in."""


SECTION = re.compile(r"^(Start|Termination):\n((?:(?: {4}.*)?\n?)+)", re.MULTILINE)
"""Section of the docstring of a scenario's class"""


def description(kind: type[Scenario]) -> dict[str, str]:
    """Return the docstring of a scenario's class, by section.

    Returns:
        ``description``, one paragraph a line, ``start`` and ``termination``; "" for
        those that neither the class nor a class above it has. The description is
        followed by that of a game that the class is derived from.
    """
    found = dict.fromkeys(("description", "start", "termination"), "")
    for base in reversed(kind.__mro__):
        if issubclass(base, Scenario) and base is not Scenario and base.__doc__:
            text = inspect.cleandoc(base.__doc__)
            found |= {k.lower(): _one_line(v) for k, v in SECTION.findall(text)}
            paragraphs = SECTION.sub("", text).strip().split("\n\n")
            if not text.startswith("Base of"):
                lines = [*map(_one_line, paragraphs), found["description"]]
                found["description"] = "\n".join(filter(None, lines))
    return found


def option_meanings(kind: type[Scenario]) -> dict[str, str]:
    """Return the docstrings of a scenario's fields, by name."""
    found: dict[str, str] = {}
    for body in _bodies(kind):
        for field, text in pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                # Without a docstring it is that of the class above.
                name = field.target.id
                found[name] = _docstring(text) or found.get(name, "")
    return found


def term_meanings(kind: type[Scenario]) -> dict[str, str]:
    """Return the meanings of reward terms, by name.

    They stand in the docstrings of `reward_terms` and `all_reward_terms`, as lines
    ``name: meaning``.
    """
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        for function in ("all_reward_terms", "reward_terms"):
            if function in vars(base):
                text = inspect.getdoc(vars(base)[function]) or ""
                found |= {k: _one_line(v) for k, v in TERM.findall(text)}
    return found


def success_meaning(kind: type[Scenario]) -> str:
    """Return the docstring of `success`, without what it says of the shape."""
    text = _one_line(inspect.getdoc(kind.success) or "")
    return text.partition(" bool: ")[2] or text


def _bodies(kind: type) -> Iterator[list[ast.stmt]]:
    """Yield the statements of the scenario's classes, the topmost first."""
    for base in reversed(kind.__mro__):
        if not issubclass(base, Scenario):
            continue
        try:
            source = textwrap.dedent(inspect.getsource(base))
        except OSError:
            continue  # A class that was written at a prompt has no source.
        (statement,) = ast.parse(source).body
        assert isinstance(statement, ast.ClassDef)
        yield statement.body


def _docstring(statement: ast.stmt) -> str:
    value = statement.value if isinstance(statement, ast.Expr) else None
    if isinstance(value, ast.Constant) and isinstance(value.value, str):
        return _one_line(value.value)
    return ""


def _one_line(text: str) -> str:
    return " ".join(text.split())
