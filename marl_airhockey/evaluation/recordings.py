"""Recordings of play: JSON lines with a meta line, a line per step, and an end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FORMAT = 1
"""Number of the format, in the meta line"""
STEP = {"n", "time", "pads", "pucks", "events", "excess", "delays", "caption"}
"""Keys that every step must have"""


def head(path: Path) -> dict[str, Any]:
    """Return the first line of a file of JSON lines; {} if it is no such file."""
    try:
        with path.open() as file:
            row = json.loads(file.readline())
    except (OSError, ValueError):
        return {}
    return row if isinstance(row, dict) else {}


def read(path: Path) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any]]:
    """Return the meta line, the steps and the end of a recording.

    The end is {} if the recording was cut off. An incomplete line, and all lines after
    it, are left out.

    Raises:
        ValueError: no recording, or one of another format.
    """
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read as a recording: {error}") from error
    rows = []
    for line in lines:
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            break
    if not rows or not isinstance(rows[0], dict) or rows[0].get("kind") != "meta":
        raise ValueError(f"{path}: no recording of airhockey play")
    if rows[0].get("format") != FORMAT:
        raise ValueError(f"{path}: format {rows[0].get('format')}, expected {FORMAT}")
    for number, row in enumerate(rows[1:], 2):
        if row.get("kind") == "step" and not row.keys() >= STEP:
            raise ValueError(f"{path}: line {number} lacks {sorted(STEP - row.keys())}")
    steps = [row for row in rows if row["kind"] == "step"]
    end = rows[-1] if rows[-1]["kind"] == "end" else {}
    return rows[0], steps, end
