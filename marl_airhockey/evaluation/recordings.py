"""Recordings of play: JSON lines with a meta line, a line per step, and an end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FORMAT = 2
"""Version of the format; 1 had other names of keys, and is refused."""


STEP = {"n", "time", "paddles", "pucks", "events", "violation", "delays", "caption"}
"""Keys that readers need of every step."""


def head(path: Path) -> dict[str, Any]:
    """Return the first line of a file of JSON lines; {} if the file is none."""
    try:
        with path.open() as file:
            row = json.loads(file.readline())
    except (OSError, ValueError):
        return {}
    return row if isinstance(row, dict) else {}


def read(path: Path) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any]]:
    """Return the meta line, the steps and the end line of a recording.

    The end is {} if the file was cut off. The first line that is not whole JSON, and
    all after it, is left out.

    Raises:
        ValueError: no recording, one of another version, or an incomplete step; names
            the file.
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
    found = rows[0].get("format")
    if found != FORMAT:
        age = "older" if isinstance(found, int) and found < FORMAT else "other"
        raise ValueError(
            f"{path}: recorded by an {age} version of marl_airhockey (format {found}); "
            f"this version reads format {FORMAT} alone"
        )
    for number, row in enumerate(rows[1:], 2):
        if row.get("kind") == "step" and not row.keys() >= STEP:
            raise ValueError(f"{path}: line {number} lacks {sorted(STEP - row.keys())}")
    steps = [row for row in rows if row["kind"] == "step"]
    end = rows[-1] if rows[-1]["kind"] == "end" else {}
    return rows[0], steps, end
