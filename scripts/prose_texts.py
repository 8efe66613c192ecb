"""Texts that people read in the files of the project."""

from __future__ import annotations

import ast
import inspect
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

SECTION = re.compile(r"^(Args|Returns|Raises|Yields|Examples?):$", re.MULTILINE)
ENTRY = re.compile(r"^    [*\w, ]+: (.*(?:\n {8,}.*)*)", re.MULTILINE)
"""Entry of the arguments in a clean docstring"""


class Text(NamedTuple):
    """Text of a file."""

    kind: str
    """One of "page", "table", "docstring", "argument", "help", "error", "comment"."""
    line: int
    content: str


def texts_of(path: Path) -> Iterator[Text]:
    """Yield the texts of a Markdown or Python file."""
    source = path.read_text()
    if path.suffix == ".md":
        yield from _paragraphs(without_code(source))
        return
    for node in ast.walk(ast.parse(source)):
        yield from _texts_at(node)
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield Text("comment", token.start[0], without_code(token.string))


def without_code(text: str) -> str:
    """Return a text without code, targets of links and addresses, line by line."""
    text = re.sub(
        r"```.*?```", lambda m: "\n" * m[0].count("\n"), text, flags=re.DOTALL
    )
    text = re.sub(r"``[^`]+``|`[^`]+`", lambda m: "`x`" + "\n" * m[0].count("\n"), text)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    return re.sub(
        r"^(?: {4,}|>>>|\.\.\.|:::).*$|https?://\S+", "", text, flags=re.MULTILINE
    )


def _paragraphs(page: str) -> Iterator[Text]:
    line = 1
    for part in re.split(r"(\n\s*\n)", page):
        if part.startswith("|"):
            for k, row in enumerate(part.splitlines()):
                yield Text("table", line + k, row)
        elif part.strip():
            yield Text("page", line, part)
        line += part.count("\n")


def _texts_at(node: ast.AST) -> Iterator[Text]:
    """Yield the docstring, help or message that begins at a syntax node."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        if isinstance(node.value.value, str):
            clean = inspect.cleandoc(node.value.value)
            # Names of arguments are code.
            prose = re.sub(r"^    [*\w, ]+: ", "", clean, flags=re.MULTILINE)
            yield Text("docstring", node.lineno, without_code(prose))
            yield from _arguments(clean, node.lineno)
    elif isinstance(node, ast.keyword) and node.arg == "help":
        if text := _words(node.value):
            yield Text("help", node.value.lineno, without_code(text))
    elif isinstance(node, ast.Raise) and node.exc is not None:
        yield Text("error", node.lineno, without_code(_words(node.exc)))


def _words(node: ast.AST) -> str:
    """Return the constant strings under a node, joined; values in them are "x"."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.FormattedValue):
        return "x"
    joint = "" if isinstance(node, ast.JoinedStr) else " "
    return joint.join(filter(None, map(_words, ast.iter_child_nodes(node))))


def _arguments(docstring: str, line: int) -> Iterator[Text]:
    """Yield the descriptions of the arguments in a docstring."""
    parts = SECTION.split(docstring)
    for title, content in zip(parts[1::2], parts[2::2], strict=True):
        if title == "Args":
            for entry in ENTRY.finditer(content):
                yield Text("argument", line, without_code(" ".join(entry[1].split())))
