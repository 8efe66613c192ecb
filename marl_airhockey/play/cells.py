"""Cells of tables: numbers with intervals, and escaped texts."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Prefixes of a text that spreadsheets read as a formula."""


def number(value: float, digits: int) -> str:
    """Return a number as text; "-" for nan."""
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def shown(values: Sequence[float], digits: int) -> str:
    """Return a value as text, with its interval if there is one; "-" for nan."""
    middle, low, high = values
    if np.isnan(middle) or np.isnan(low):
        return number(middle, digits)
    return f"{middle:.{digits}f} ({low:.{digits}f}..{high:.{digits}f})"


def markdown(header: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    cells = [header, ["---"] * len(header), *rows]
    return ["| " + " | ".join(map(_markdown_cell, row)) + " |" for row in cells]


def _markdown_cell(value: object) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")


def write_csv(
    path: Path, names: Sequence[str], rows: Sequence[Mapping[str, Any]]
) -> None:
    """Write rows as CSV; a text that looks like a formula gets an apostrophe."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        for row in rows:
            writer.writerow({name: _csv_cell(row[name]) for name in names})


def _csv_cell(value: object) -> object:
    is_formula = isinstance(value, str) and value.startswith(FORMULA)
    return f"'{value}" if is_formula else value
