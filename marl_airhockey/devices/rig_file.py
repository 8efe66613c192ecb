"""Files of rigs: JSON with a format and the kind of rig."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

FORMAT = 1
"""Format of the files"""
WRITERS = {"table": "airhockey calibrate", "hand": "airhockey calibrate --hand"}
"""Command that writes a rig, by its kind"""


def save_rig(path: Path, kind: str, fields: Mapping[str, Any]) -> None:
    """Write the fields of a rig.

    Args:
        path: of the file; its folder is made.
        kind: one of `WRITERS`.
        fields: by name.
    """
    whole = {"format": FORMAT, "kind": kind, **fields}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(whole, indent=1, default=_plain) + "\n")


def load_rig(path: Path, kind: str) -> dict[str, Any]:
    """Read the fields of a rig.

    Raises:
        ValueError: a file that is missing, no rig, of another format or kind.
    """
    try:
        given = json.loads(path.read_text())
    except FileNotFoundError:
        raise ValueError(
            f"{path}: there is no rig; {WRITERS[kind]} writes one"
        ) from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error
    return rig_fields(path, given, kind)


def rig_fields(path: Path, given: Any, kind: str) -> dict[str, Any]:
    """Return the fields of a rig that a file holds as a JSON object.

    Raises:
        ValueError: it is none, or of another format or kind.
    """
    given = dict(given) if isinstance(given, dict) else given
    found = given.pop("format", None) if isinstance(given, dict) else None
    if found != FORMAT:
        raise ValueError(f"{path}: format {found!r}, this version reads {FORMAT}")
    other = given.pop("kind", "table")
    if other != kind:
        raise ValueError(
            f"{path}: this is the rig of a {other}, and that of a {kind} is needed; "
            f"{WRITERS[kind]} writes one"
        )
    return dict(given)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else str(value)
