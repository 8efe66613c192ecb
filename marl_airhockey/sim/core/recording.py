"""Recording: columns of recorded episodes, and their files.

A recording is a folder that pandas or duckdb can read without this library:

    meta.json              scenario, options, players, versions; the columns of steps,
                           each with type, shape, unit and frame
    episodes.parquet       a row for each episode: seed, physics, length, success, end
    steps/part-*.parquet   a row for each control step, numbered by `episode` and `step`
    film.mkv               frames of a camera, if any; film.times.txt has their times

Step 0 of an episode is the state before its first step. Columns that exist only for
steps, such as action and reward, have no value there: nan, or 0 for types without nan.
Arrays are flattened. `shape` in `meta.json` is the shape of one step. Nothing is
rounded. `marl_airhockey.data.writer` and `reader` write and read recordings.
docs/formats.md lists the columns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.types import Array

FORMAT = 4
"""Version of the format."""
META, EPISODES, STEPS, FILM = "meta.json", "episodes.parquet", "steps", "film.mkv"
"""Names of the files and of the folder of steps in a recording."""
PHYSICS = "physics."
"""Prefix of the columns of episodes that hold physical parameters."""
PLAYED = "played to the end"
"""Reason of the end of an episode that ended by its rules or its time limit."""
KINDS = "biuf"
"""Kinds of NumPy types that a column may have: bool, integers, floats."""
FINITE = (
    *("state.position", "state.velocity", "state.angle", "state.spin", "state.time"),
    *("action", "command", "reward", "observation"),
    *(
        f"observation.{name}"
        for name in ("observation", "achieved_goal", "desired_goal")
    ),
)
"""Columns in which no number may be missing."""
Columns = dict[str, Array]

_PLACE, _MOTION = ("m", "table"), ("m/s", "table")
_ACTION = ("fraction of top speed", "ego")
UNITS: Mapping[str, tuple[str, str]] = {
    "state.position": _PLACE,
    "state.velocity": _MOTION,
    "state.angle": ("rad", "table"),
    "state.spin": ("rad/s", "table"),
    "state.time": ("s", ""),
    "state.touched_at": ("s", ""),
    "state.crossed_velocity": _MOTION,
    "sensed.position": _PLACE,
    "sensed.velocity": _MOTION,
    "sensed.age": ("s", ""),
    "action": _ACTION,
    "delayed_action": _ACTION,
    "applied_action": _ACTION,
    "command": _MOTION,
    "violation": ("m/s, m/s2, m/s3, m/s, sum in units of the limits", ""),
    "clock": ("s, Unix time", ""),
    "round_trip": ("ms", ""),
    "pointer": ("m", "table"),
    **dict.fromkeys(
        (f"device.{name}" for name in ("moment", "captured", "received", "applied")),
        ("s, monotonic", ""),
    ),
    "frame_taken": ("s, monotonic", ""),
}
"""Unit and frame of the columns that have one, by name."""


class Column(NamedTuple):
    """Column of the steps of a recording."""

    dtype: str
    """Name of the type, for example float64."""
    shape: tuple[int, ...]
    """Shape of the value in one step."""
    unit: str = ""
    frame: str = ""
    """Coordinate frame: table, or the ego frame of each seat."""

    @classmethod
    def of(cls, name: str, value: Array) -> Column:
        """Return the column that fits the value of one step.

        Raises:
            ValueError: The value does not consist of numbers.
        """
        if value.dtype.kind not in KINDS:
            raise ValueError(f"{name}: a column cannot hold {value.dtype}")
        dtype = value.dtype.newbyteorder("=").name
        return cls(dtype, value.shape, *UNITS.get(name, ("", "")))

    @classmethod
    def from_fields(cls, name: str, fields: Any) -> Column:
        """Return the column that an entry of `meta.json` describes.

        Raises:
            ValueError: The entry does not describe a column.
        """
        try:
            dtype, shape = np.dtype(fields["dtype"]), [int(n) for n in fields["shape"]]
            texts = str(fields.get("unit", "")), str(fields.get("frame", ""))
        except (TypeError, KeyError, AttributeError, ValueError) as error:
            raise ValueError(
                f"column {name}: {fields!r}; expected a dtype and a shape"
            ) from error
        if dtype.kind not in KINDS or min(shape, default=0) < 0:
            raise ValueError(f"column {name}: {dtype} {shape} is not a valid column")
        return cls(dtype.name, tuple(shape), *texts)

    @property
    def size(self) -> int:
        """Number of elements in one step."""
        return int(np.prod(self.shape, dtype=np.int64))

    def missing(self) -> Array:
        """Return the value for a step without one: nan, or 0 for types without nan."""
        dtype = np.dtype(self.dtype)
        return np.full(self.shape, np.nan if dtype.kind == "f" else 0, dtype)


@dataclass(frozen=True)
class Episode:
    """Recorded episode of T control steps."""

    index: int
    """Index in the recording."""
    seed: int | None
    number: int
    """Number of the episode since the world was seeded."""
    physics: Mapping[str, float]
    """Physical parameters by name."""
    reason: str
    """Reason of the end; "" if the recording was interrupted before the end."""
    first: Columns
    """Arrays (...) before the first step."""
    columns: Columns
    """Arrays (T, ...) after each step."""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True)
class Recording:
    """Recording that was read from a folder."""

    path: Path
    head: dict[str, Any]
    """Content of `meta.json`."""
    episodes: list[Episode]
