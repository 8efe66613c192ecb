"""Rows of results that scripts keep in CSV files, one for each run that has ended."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def read(path: Path) -> list[Row]:
    """Return the rows of a CSV file; none if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def keep(path: Path, row: Row, order: Callable[[Any], Any]) -> None:
    """Add a row to those of a CSV file, in order; the file is replaced as a whole.

    Args:
        path: Path of the file.
        row: New row, with the columns of all.
        order: Function of a row, all strings, that returns what it is sorted by.
    """
    rows = [*read(path), {name: str(value) for name, value in row.items()}]
    draft = path.with_suffix(".part")
    with draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=order))
    draft.replace(path)
