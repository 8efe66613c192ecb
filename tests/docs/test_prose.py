"""The check of the prose finds what it names, and nothing in code."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

import check_prose


@pytest.fixture
def words():
    return check_prose.words_of({"anew": "again", "told": "given"})


def found(tmp_path, name, content, words):
    (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
    (tmp_path / name).write_text(content)
    return [(f.line, f.rule) for f in check_prose.findings(tmp_path, words)]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("# A\n\nIt begins anew.\n", [(3, "words")]),
        ("# A\n\nIt `begins anew` now.\n", []),
        ("# A\n\nText.\n\n    begin anew\n", []),
        ("# A\n\n    airhockey list\n", [(3, "opening")]),
        ("# A\n\n" + "word " * 26 + "end.\n", [(3, "width"), (3, "sentences")]),
        ("# A\n\n" + "word " * 12 + "end. Other words.\n", []),
        ("# A\n\nText.\n\n|" + "a|" * 9 + "\n", [(5, "columns")]),
        ("# A\n\nIt used to be so.\n", [(3, "history")]),
    ],
)
def test_pages_are_checked(tmp_path, words, content, expected):
    assert found(tmp_path, "docs/a.md", content, words) == expected


CODE = '''"""Module."""


def add(a, b):
    """Add anew.

    Args:
        a: {entry}
        b: Second number
            with a unit, m.
    """
    raise ValueError(f"told {{a}} {{b}}")  # told
'''


def test_code_is_checked_by_its_parts(tmp_path, words):
    place = "marl_airhockey/sim/core/a.py"
    right = found(tmp_path, place, CODE.format(entry="First number, m."), words)
    assert sorted(right) == [(5, "words"), (12, "words"), (12, "words")]
    for entry in (
        "of the first.",
        "(B,) m.",
        "Number.",
        "first number.",
        "No full stop",
    ):
        lines = found(tmp_path, place, CODE.format(entry=entry), words)
        assert (5, "fragments") in lines, entry
