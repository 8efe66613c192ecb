"""Meanings of options, success and reward terms, from docstrings of a scenario."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from itertools import pairwise

from marl_airhockey.sim.contracts.scenario import Scenario

TERM = re.compile(r"^ *(\w+): (.+?)(?=\n *\w+: |\n\n|\Z)", re.MULTILINE | re.DOTALL)
"""Pattern of ``name: meaning`` in a docstring, with continuation lines."""


SECTION = re.compile(r"^(Start|Termination):\n((?:(?: {4}.*)?\n?)+)", re.MULTILINE)
"""Pattern of a section in the docstring of a scenario's class."""


def description(kind: type[Scenario]) -> dict[str, str]:
    """Return the docstring of a scenario's class, by section.

    Returns:
        ``description`` with one paragraph per line, ``start`` and ``termination``. A
        section is "" if neither the class nor a base class has it. The description of
        a base class, unless it starts with "Base of", follows.
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
                # A field without a docstring has the meaning in the base class.
                name = field.target.id
                found[name] = _docstring(text) or found.get(name, "")
    return found


def term_meanings(kind: type[Scenario]) -> dict[str, str]:
    """Return the meanings of reward terms, by name.

    The docstrings of `reward_terms` and `all_reward_terms` contain them as lines
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
    """Return the docstring of `success` without the shape and type."""
    text = _one_line(inspect.getdoc(kind.success) or "")
    return text.partition(" bool: ")[2] or text


def _bodies(kind: type) -> Iterator[list[ast.stmt]]:
    """Yield the statements of a scenario's classes, base classes first."""
    for base in reversed(kind.__mro__):
        if not issubclass(base, Scenario):
            continue
        try:
            source = textwrap.dedent(inspect.getsource(base))
        except OSError:
            continue  # A class defined at a prompt has no source.
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
