"""Check the prose of pages, docstrings, command help, error messages and comments.

    python scripts/check_prose.py           # list all findings
    python scripts/check_prose.py docs      # list those of paths that begin so

The rules are those of CONTRIBUTING.md. `prose.toml` lists the words to avoid.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import typer
from prose_texts import Text, texts_of

ROOT = Path(__file__).parent.parent
RULES = Path(__file__).with_name("prose.toml")
FOLDERS = ("docs", "drivers", "marl_airhockey", "plugins", "scenarios", "scripts")
PAGES = ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "CHANGELOG.md")
LONGEST_SENTENCE, LONGEST_LINE, MOST_COLUMNS = 25, 100, 8
SENTENCE_END = re.compile(r"(?<=[.!?:;])\s+(?=[A-Z`*\"(\[])|\n\s*\n|\n\s*[-*|\d]")
FRAGMENT = re.compile(
    r"^(of|its|their|the same|see|as|by|in|from|to|for|which|where|how|what|whether)\b"
    r"|^\W*\w*\W*$|^\(",
    re.IGNORECASE,
)
"""Start of a description that lacks its noun, or a description of a single word"""
HISTORY = re.compile(
    r"\b(used to be|before that change|earlier versions?|until now|since commit|"
    r"commit [0-9a-f]{7}|version 0)\b",
    re.IGNORECASE,
)


class Finding(NamedTuple):
    """Break of a rule."""

    path: str
    line: int
    rule: str
    text: str


def word_findings(text: Text, words: dict[re.Pattern[str], str]) -> Iterator[str]:
    """Yield the words that should be others."""
    for pattern, better in words.items():
        for found in pattern.finditer(text.content):
            yield f"{found[0]!r}: write {better}"


def sentence_findings(text: Text) -> Iterator[str]:
    """Yield sentences of pages that are too long."""
    for sentence in SENTENCE_END.split(text.content):
        count = len(re.findall(r"[\w'/.-]*\w[\w'/.-]*", sentence))
        if text.kind == "page" and count > LONGEST_SENTENCE:
            yield f"{count} words: {' '.join(sentence.split())[:60]}"


def fragment_findings(text: Text) -> Iterator[str]:
    """Yield descriptions of options and arguments that are no full phrases."""
    content = " ".join(text.content.split())
    whole = content[:1].isupper() or content[:1] in "`\"'0123456789"
    if text.kind in ("help", "argument") and (
        FRAGMENT.search(content) or not whole or not content.endswith((".", ".)", "`"))
    ):
        yield content[:60]


def page_findings(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield (line, rule, text) of the layout of a Markdown page."""
    lines = path.read_text().splitlines()
    for number, line in enumerate(lines, 1):
        table = line.startswith("|")
        code = line.startswith("    ")
        if len(line) > LONGEST_LINE and not table and not code and "](" not in line:
            yield number, "width", f"{len(line)} columns"
        if table and line.count("|") - line.count(r"\|") - 1 > MOST_COLUMNS:
            yield number, "columns", f"{line.count('|') - 1} columns"
        if path.name != "CHANGELOG.md" and (found := HISTORY.search(line)):
            yield number, "history", found[0]
    first = next((k for k, line in enumerate(lines) if line and line[0] != "#"), None)
    if first is not None and lines[first].startswith(("    ", "|", "```")):
        yield first + 1, "opening", "begins with a command or a table"


def findings(root: Path, words: dict[re.Pattern[str], str]) -> Iterator[Finding]:
    """Yield all findings of a checkout."""
    files = [root / name for name in PAGES]
    files += [
        p for f in FOLDERS for e in ("md", "py") for p in (root / f).rglob(f"*.{e}")
    ]
    generated = {root / "docs/cli.md", *(root / "docs/scenarios").glob("*.md")}
    files = [p for p in files if p.exists() and p not in generated]
    for path in sorted(p for p in files if not p.is_symlink()):
        name = path.relative_to(root).as_posix()
        if path.suffix == ".md":
            for line, rule, what in page_findings(path):
                yield Finding(name, line, rule, what)
        for text in texts_of(path):
            for what in word_findings(text, words):
                yield Finding(name, text.line, "words", what)
            for what in sentence_findings(text):
                yield Finding(name, text.line, "sentences", what)
            for what in fragment_findings(text):
                yield Finding(name, text.line, "fragments", what)


def words_of(given: dict[str, str]) -> dict[re.Pattern[str], str]:
    """Return the words to avoid as patterns, and the standard ones."""
    flags = re.IGNORECASE
    return {re.compile(rf"\b(?:{word})\b", flags): to for word, to in given.items()}


def main(
    paths: Annotated[
        list[str] | None, typer.Argument(help="Start of the paths to list. All files.")
    ] = None,
) -> None:
    """List the findings; exit with status 1 if there are any."""
    words = words_of(tomllib.loads(RULES.read_text())["words"])
    chosen = tuple(paths or [""])
    found = [f for f in findings(ROOT, words) if f.path.startswith(chosen)]
    for each in found:
        print(f"{each.path}:{each.line}: {each.rule}: {each.text}")
    sys.exit(bool(found))


if __name__ == "__main__":
    typer.run(main)
