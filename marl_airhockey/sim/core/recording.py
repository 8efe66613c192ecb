"""Recording: columns of recorded episodes, and their files.

A recording is a folder that pandas or duckdb read without this library:

    meta.json              scenario, options, players, versions; the columns of steps,
                           each with type, shape, unit and frame
    episodes.parquet       a row for each episode: seed, physics, length, success, end
    steps/part-*.parquet   a row for each control step, numbered by `episode` and `step`
    film.mkv               frames of a camera, if any; film.times.txt has their times

Step 0 of an episode is what was there before its first step. Columns that a step alone
has, as action and reward, hold no number there: nan, or 0 where there is no nan. Arrays
of more than one number are flattened; `shape` in `meta.json` is that of one step.
Nothing is rounded. `marl_airhockey.data.writer` and `reader` write and read it;
docs/data.md lists the columns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.types import Array

FORMAT = 4
"""Version of the format"""
META, EPISODES, STEPS, FILM = "meta.json", "episodes.parquet", "steps", "film.mkv"
"""Names of the files and of the folder of steps in a recording"""
PHYSICS = "physics."
"""Beginning of the names of columns of episodes that hold physical parameters"""
PLAYED = "played to the end"
"""Reason of the end of an episode that its rules or its clock ended"""
KINDS = "biuf"
"""Kinds of numbers that columns may have: bool, integers, floats"""
FINITE = (
    *("state.position", "state.velocity", "state.angle", "state.spin", "state.time"),
    *("action", "command", "reward", "observation"),
    *(
        f"observation.{name}"
        for name in ("observation", "achieved_goal", "desired_goal")
    ),
)
"""Columns in which no number may be missing"""
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
    "violation": ("fraction of the limit", ""),
    "clock": ("s, Unix time", ""),
    "round_trip": ("ms", ""),
    "pointer": ("m", "table"),
    "device.moment": ("s, monotonic", ""),
    "frame_taken": ("s, monotonic", ""),
}
"""Unit and frame of the columns that have one, by name"""


class Column(NamedTuple):
    """Column of steps."""

    dtype: str
    """Name of its type, as float64"""
    shape: tuple[int, ...]
    """Shape of its value in one step"""
    unit: str = ""
    frame: str = ""
    """Frame of coordinates: table, or the ego frame of each seat"""

    @classmethod
    def of(cls, name: str, value: Array) -> Column:
        """Return the description of a column whose value in one step this is.

        Raises:
            ValueError: Not numbers.
        """
        if value.dtype.kind not in KINDS:
            raise ValueError(f"{name}: a column cannot hold {value.dtype}")
        dtype = value.dtype.newbyteorder("=").name
        return cls(dtype, value.shape, *UNITS.get(name, ("", "")))

    @classmethod
    def from_fields(cls, name: str, fields: Any) -> Column:
        """Return a column as `meta.json` describes it.

        Raises:
            ValueError: No description of a column.
        """
        try:
            dtype, shape = np.dtype(fields["dtype"]), [int(n) for n in fields["shape"]]
            texts = str(fields.get("unit", "")), str(fields.get("frame", ""))
        except (TypeError, KeyError, AttributeError, ValueError) as error:
            raise ValueError(f"column {name}: {fields!r} describes none") from error
        if dtype.kind not in KINDS or min(shape, default=0) < 0:
            raise ValueError(f"column {name}: {dtype} {shape} cannot be")
        return cls(dtype.name, tuple(shape), *texts)

    @property
    def size(self) -> int:
        """Number of numbers in one step."""
        return int(np.prod(self.shape, dtype=np.int64))

    def missing(self) -> Array:
        """Return its value in a step that has none."""
        dtype = np.dtype(self.dtype)
        return np.full(self.shape, np.nan if dtype.kind == "f" else 0, dtype)


@dataclass(frozen=True)
class Episode:
    """Recorded episode of T control steps."""

    index: int
    """Number in the recording"""
    seed: int | None
    number: int
    """Number of the episode since the world had that seed"""
    physics: Mapping[str, float]
    """Physical parameters by name"""
    reason: str
    """Reason of its end; "" if the recording was interrupted before"""
    first: Columns
    """Arrays (...) before the first step"""
    columns: Columns
    """Arrays (T, ...) after each step"""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True)
class Recording:
    """Recording that has been read."""

    path: Path
    head: dict[str, Any]
    """Contents of `meta.json`"""
    episodes: list[Episode]
