"""Recording: the file format of all that is recorded, of one episode or of many.

A file is a row of blocks. A block is a line of JSON and, if that has ``arrays``, the
arrays it lists, compressed, and a line feed:

    {"kind": "head", "format": 3, "scenario": ..., "control_dt": ...}
    {"kind": "begin", "episode": 0, ..., "arrays": [[name, dtype, shape], ...],
     "size": bytes, "crc": of them}
    {"kind": "steps", "episode": 0, "arrays": ...}     any number, in order
    {"kind": "end", "episode": 0, ...}

The arrays of ``begin`` are what was there before the first step; those of ``steps``
have a row for each control step. Numbers are little-endian. A block that is not whole
is where the writer was killed: what stands before it is good. docs/data.md lists the
names of arrays and keys.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from marl_airhockey.core.blocks import LONGEST_LINE, Columns, blocks, packed

FORMAT = 3
"""Version of the format; those before were lines of JSON alone"""
SUFFIX = ".rec"
"""Ending of the names of files"""
FLUSH = 0.5
"""Longest time for which steps wait until they are written, s"""
FINITE = (
    *("state.position", "state.velocity", "state.angle", "state.spin", "state.time"),
    *("action", "command", "reward"),
)
"""Columns in which no number may be missing"""


@dataclass(frozen=True)
class RecordedEpisode:
    """Recorded episode of T control steps."""

    notes: dict[str, Any]
    """What holds for all of it: seed, physics"""
    first: Columns
    """Arrays (...) before the first step"""
    columns: Columns
    """Arrays (T, ...) after each step"""
    end: dict[str, Any]
    """How it ended; {} if the recording was cut off before"""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True)
class Recording:
    """Contents of a file."""

    path: Path
    head: dict[str, Any]
    """What holds for all episodes: scenario, options, control_dt, players"""
    episodes: list[RecordedEpisode]


class RecordingWriter:
    """Writer of a file; what it has flushed survives a kill of the process.

    Args:
        path: of the new file.
        head: what holds for all episodes; JSON.

    Raises:
        FileExistsError: there is such a file.
    """

    def __init__(self, path: Path, head: Mapping[str, Any]) -> None:
        self.path = path
        self._file = path.open("xb")
        self._rows: list[Columns] = []
        self._episode = -1
        self._flushed = time.monotonic()
        self._write("head", {"format": FORMAT, **head})

    def begin(self, notes: Mapping[str, Any], first: Columns) -> None:
        """Begin the next episode with what is there before its first step."""
        self._episode += 1
        self._write("begin", {"episode": self._episode, **notes}, first)

    def add(self, row: Columns) -> None:
        """Add a control step, which is on the disk within a second."""
        self._rows.append({name: np.array(value) for name, value in row.items()})
        if time.monotonic() - self._flushed > FLUSH:
            self.flush()

    def flush(self) -> None:
        """Write the steps that wait, to the disk."""
        if self._rows:
            names = self._rows[0]
            self.add_rows({n: np.stack([row[n] for row in self._rows]) for n in names})
            self._rows = []
        self._flushed = time.monotonic()
        os.fsync(self._file.fileno())

    def add_rows(self, columns: Columns) -> None:
        """Add control steps, arrays (T, ...)."""
        self._write("steps", {"episode": self._episode}, columns)

    def end(self, notes: Mapping[str, Any]) -> None:
        """End the episode."""
        self.flush()
        self._write("end", {"episode": self._episode, **notes})

    def close(self) -> None:
        """Close the file."""
        self.flush()
        self._file.close()

    def _write(
        self, kind: str, notes: Mapping[str, Any], arrays: Columns | None = None
    ) -> None:
        self._file.write(packed({"kind": kind, **notes}, arrays))
        # Handed to the operating system: a killed process loses nothing of it.
        self._file.flush()


def read_head(path: Path) -> dict[str, Any]:
    """Return the first line of a recording.

    Raises:
        ValueError: no recording, or one of another version; names the file.
    """
    with _opened(path) as file:
        return _head(path, file)


def read_recording(path: Path) -> Recording:
    """Read a file.

    Raises:
        ValueError: no recording, one of another version, or one that makes no sense;
            names the file and what is wrong.
    """
    with _opened(path) as file:
        head = _head(path, file)
        parts: dict[int, _Parts] = {}
        try:
            for line, arrays in blocks(file):
                number = line["episode"]
                if line["kind"] == "begin":
                    parts[number] = _Parts(line, arrays)
                else:
                    parts[number].add(line, arrays)
            episodes = [part.joined() for part in parts.values()]
        except (KeyError, TypeError) as error:
            raise ValueError(f"{path}: {error} is missing or wrong") from error
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
    return Recording(path, head, episodes)


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be read as a recording: {error.strerror}"
        ) from error


def _head(path: Path, file: BinaryIO) -> dict[str, Any]:
    try:
        head = json.loads(file.readline(LONGEST_LINE))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: no recording of marl_airhockey") from error
    if not isinstance(head, dict) or head.get("kind") not in ("head", "meta"):
        raise ValueError(f"{path}: no recording of marl_airhockey")
    found, dt = head.get("format"), head.get("control_dt")
    if found != FORMAT:
        age = "older" if isinstance(found, int) and found < FORMAT else "other"
        raise ValueError(
            f"{path}: recorded by an {age} version of marl_airhockey (format {found}); "
            f"this version reads format {FORMAT} alone"
        )
    if not isinstance(head.get("scenario"), str):
        raise ValueError(f"{path}: it does not name its scenario")
    if not (isinstance(dt, (int, float)) and 0.0 < dt < float("inf")):
        raise ValueError(f"{path}: control_dt {dt!r} is no time of a step")
    return head


class _Parts:
    """Parts of an episode as they are read."""

    def __init__(self, line: dict[str, Any], first: Columns) -> None:
        self._notes, self._first = line, first
        self._steps: list[Columns] = []
        self._end: dict[str, Any] = {}

    def add(self, line: dict[str, Any], arrays: Columns) -> None:
        if line["kind"] == "end":
            self._end = line
            return
        lengths = {len(value) for value in arrays.values()}
        if len(lengths) != 1:
            raise ValueError(f"{self._name}: its columns have {sorted(lengths)} rows")
        if self._steps and arrays.keys() != self._steps[0].keys():
            raise ValueError(f"{self._name}: its columns change")
        for name, value in arrays.items():
            if name in FINITE and not np.isfinite(value).all():
                row = int(np.argwhere(~np.isfinite(value))[0, 0])
                row += sum(len(next(iter(step.values()))) for step in self._steps)
                raise ValueError(f"{self._name}: {name} is not finite at step {row}")
        self._steps.append(arrays)

    @property
    def _name(self) -> str:
        return f"episode {self._notes['episode']}"

    def joined(self) -> RecordedEpisode:
        """Return the episode.

        Raises:
            ValueError: parts that do not fit.
        """
        names = self._steps[0] if self._steps else {}
        try:
            columns = {n: np.concatenate([s[n] for s in self._steps]) for n in names}
        except ValueError as error:
            raise ValueError(f"{self._name}: its columns change: {error}") from error
        return RecordedEpisode(self._notes, self._first, columns, self._end)
