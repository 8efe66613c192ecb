"""Files of rigs: JSON objects with the version of the format and the kind of rig."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

FORMAT = 1
"""Version of the file format."""
WRITERS = {"table": "airhockey calibrate", "hand": "airhockey calibrate --hand"}
"""Command that writes a rig, by its kind."""


def save_rig(path: Path, kind: str, fields: Mapping[str, Any]) -> None:
    """Write the fields of a rig.

    Args:
        path: Path of the file; its folder is created.
        kind: Kind of the rig, a key of `WRITERS`.
        fields: Fields by name.
    """
    whole = {"format": FORMAT, "kind": kind, **fields}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(whole, indent=1, default=_plain) + "\n")


def load_rig(path: Path, kind: str) -> dict[str, Any]:
    """Read the fields of a rig.

    Raises:
        ValueError: The file is missing or is not a rig, or its format or kind is wrong.
    """
    try:
        given = json.loads(path.read_text())
    except FileNotFoundError:
        raise ValueError(
            f"{path}: the file does not exist; {WRITERS[kind]} writes it"
        ) from None
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(
            f"{path}: not a rig, expected a JSON file; {WRITERS[kind]} writes one "
            f"({error})"
        ) from error
    return rig_fields(path, given, kind)


def rig_fields(path: Path, given: Any, kind: str) -> dict[str, Any]:
    """Return the fields of a rig from the content of its file.

    Args:
        path: Path of the file, for messages.
        given: Content of the file.
        kind: Expected kind of the rig, a key of `WRITERS`.

    Raises:
        ValueError: The content is not a rig, or its format or kind is wrong.
    """
    given = dict(given) if isinstance(given, dict) else given
    found = given.pop("format", None) if isinstance(given, dict) else None
    if found is None:
        raise ValueError(
            f"{path}: not a rig, it has no format; {WRITERS[kind]} writes one"
        )
    if found != FORMAT:
        raise ValueError(f"{path}: format {found!r}, expected {FORMAT}")
    other = given.pop("kind", "table")
    if other != kind:
        raise ValueError(
            f"{path}: the rig of a {other}, expected the rig of a {kind}; "
            f"{WRITERS[kind]} writes one"
        )
    return dict(given)


def check_tags(tags: Mapping[str, list[list[float]]]) -> None:
    """Check that every tag has a number and four corners (4, 2), m.

    Raises:
        ValueError: A tag has another name or shape.
    """
    for number, corners in tags.items():
        if not number.isdecimal() or np.shape(corners) != (4, 2):
            raise ValueError(
                f"tags: {number!r}: {corners}; expected a number and four corners, x "
                "and y, m"
            )


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else str(value)
