"""Writer of recordings: what it has flushed survives a kill of the process."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from marl_airhockey.data.blocks import DiskWriter, PendingSteps
from marl_airhockey.data.files import parent_of
from marl_airhockey.data.parquet import EXTRA, warm_up
from marl_airhockey.data.parts import merge_parts, parts_of
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import (
    FORMAT,
    META,
    PHYSICS,
    STEPS,
    Column,
    Columns,
    Episode,
)

FLUSH = 0.5
"""Longest time for which steps wait until they are on the disk, s"""
PART = 16_384
"""Number of steps that wait at most"""


@contextmanager
def whole_recording(path: Path, head: Mapping[str, Any]) -> Iterator[RecordingWriter]:
    """Write a recording that is there whole or, after any error, not at all.

    Args:
        path: Folder, which must not exist.
        head: What holds for all episodes; its columns are those that are written.

    Raises:
        ValueError: There is such a folder.
    """
    with parent_of(path):
        try:
            writer = RecordingWriter(path, {**head, "columns": {}})
        except FileExistsError as error:
            raise ValueError(f"{path}: there is such a folder; name another") from error
        except OSError as error:
            raise ValueError(f"{path}: cannot be made: {error.strerror}") from error
        try:
            with writer:
                yield writer
        except BaseException:
            shutil.rmtree(path, ignore_errors=True)
            raise


class RecordingWriter:
    """Writer of a recording.

    A thread of its own writes to the disk, so that `add` and `end` return at once.

    Args:
        path: Folder, which must not exist.
        head: What holds for all episodes; JSON.

    Raises:
        FileExistsError: There is such a folder.
        OSError: It cannot be made.
    """

    def __init__(self, path: Path, head: Mapping[str, Any]) -> None:
        require("pyarrow", EXTRA)
        path.mkdir(parents=True)
        (path / STEPS).mkdir()
        self._start(path, {**head, "format": FORMAT}, [], 0)
        try:
            self._write_meta()
        except OSError:
            self._disk.close()
            self._lock.release()
            shutil.rmtree(path, ignore_errors=True)
            raise

    @classmethod
    def extend(
        cls, path: Path, head: Mapping[str, Any], episodes: list[dict[str, Any]]
    ) -> RecordingWriter:
        """Return a writer that extends a recording.

        Args:
            path: Folder of a recording whose episodes are all complete.
            head: Contents of its `meta.json`.
            episodes: Rows of its `episodes.parquet`.

        Raises:
            RuntimeError: Another process writes it.
        """
        writer = cls.__new__(cls)
        parts = parts_of(path)
        number = int(parts[-1].stem.removeprefix("part-")) + 1 if parts else 0
        writer._start(path, dict(head), episodes, number)
        return writer

    def _start(
        self, path: Path, head: dict[str, Any], rows: list[dict[str, Any]], part: int
    ) -> None:
        self.path, self._head, self._episodes = path, head, rows
        self._lock = FileLock(path / ".lock", timeout=0)
        try:
            self._lock.acquire()
        except Timeout as error:
            raise RuntimeError(f"{path}: another process writes it") from error
        self._layout: dict[str, Column] = {
            name: Column.from_fields(name, fields)
            for name, fields in head.get("columns", {}).items()
        }
        self._first: Columns | None = None
        self._waiting: list[PendingSteps] = []
        self._count, self._step = 0, 0
        # The first calls of pyarrow take half a second.
        warm_up()
        self._disk = DiskWriter(path, part)
        self._flushed, self._changed = time.monotonic(), False

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def episodes(self) -> int:
        """Number of episodes that have begun."""
        return len(self._episodes)

    def begin(
        self,
        first: Columns,
        seed: int | None = None,
        number: int = 0,
        physics: Mapping[str, float] | None = None,
    ) -> None:
        """Begin the next episode.

        Args:
            first: What is there before its first step.
            seed: Seed of its world.
            number: Number of the episode since the world had that seed.
            physics: Its physical parameters.
        """
        self._place_first()
        own = {f"{PHYSICS}{k}": float(v) for k, v in (physics or {}).items()}
        row = {"episode": len(self._episodes), "seed": seed, "number": number}
        ends = {"length": 0, "returns": [], "success": [], "reason": ""}
        self._episodes.append({**row, **ends, **own})
        self._first = {n: np.array(value)[None] for n, value in first.items()}
        self._step, self._changed = 0, True

    def add(self, row: Columns) -> None:
        """Add a control step, which is on the disk within a second."""
        self.add_rows({name: np.array(value)[None] for name, value in row.items()})
        self._flush_in_time()

    def add_rows(self, columns: Columns) -> None:
        """Add control steps, arrays (T, ...).

        Raises:
            ValueError: Columns that are not those of the steps before; named.
        """
        lengths = {len(value) for value in columns.values()}
        if len(lengths) != 1:
            raise ValueError(f"columns have {sorted(lengths)} rows")
        self._place_first(columns)
        self._put(columns, lengths.pop())
        row = self._episodes[-1]
        row["length"] = self._step - 1
        for name in ("returns", "success"):
            if name in columns:
                row[name] = np.atleast_1d(columns[name][-1]).astype(float).tolist()
        if self._count >= PART:
            self.flush()

    def end(self, reason: str) -> None:
        """End the episode, and say why it ended."""
        self._place_first()
        self._episodes[-1]["reason"], self._changed = reason, True
        self._flush_in_time()

    def write(self, episode: Episode) -> None:
        """Write a whole episode; one without a reason of its end is interrupted."""
        self.begin(episode.first, episode.seed, episode.number, episode.physics)
        if len(episode):
            self.add_rows(episode.columns)
        if episode.reason:
            self.end(episode.reason)

    def _flush_in_time(self) -> None:
        """Have a thread write what waits; whoever adds steps must not wait for it."""
        written = self._collect(wait=False)
        if written and time.monotonic() - self._flushed > FLUSH:
            self._flushed = time.monotonic()
            episodes = [dict(row) for row in self._episodes] if self._changed else []
            self._changed, blocks = False, self._waiting[:]
            self._disk.start(episodes, blocks, self._layout)

    def _collect(self, wait: bool) -> bool:
        """Return whether the thread has written what it was given.

        Args:
            wait: Whether to wait for it.

        Raises:
            OSError: It could not; what it was given still waits.
        """
        try:
            count = self._disk.collect(wait)
        except OSError:
            self._changed = True
            raise
        self._count -= sum(block.size for block in self._waiting[: count or 0])
        del self._waiting[: count or 0]
        return count is not None

    def flush(self) -> None:
        """Write the steps that wait, to the disk."""
        self._collect(wait=True)
        self._flushed = 0.0
        self._flush_in_time()
        self._collect(wait=True)

    def close(self) -> None:
        """Write what waits, merge small parts, and close."""
        if not self._lock.is_locked:
            return
        try:
            self._place_first()
            self.flush()
            steps = sum(row["length"] + 1 for row in self._episodes)
            if self._disk.part > 1 + 2 * steps / PART:
                merge_parts(self.path)
        finally:
            self._disk.close()
            with suppress(OSError):  # Windows deletes no open file.
                (self.path / ".lock").unlink()
            self._lock.release()

    def _place_first(self, columns: Columns | None = None) -> None:
        """Put what was there before the first step in front of it.

        Only with its first step is it known which columns steps have.
        """
        if self._first is None:
            return
        first, self._first = self._first, None
        if not self._layout:
            both = {**first, **(columns or {})}
            self._layout = {name: Column.of(name, v[0]) for name, v in both.items()}
            self._write_meta()
        missing = {
            name: column.missing()[None]
            for name, column in self._layout.items()
            if name not in first
        }
        self._put({**missing, **first}, 1)

    def _put(self, columns: Columns, count: int) -> None:
        """Let steps wait to be written."""
        if columns.keys() != self._layout.keys():
            odd = ", ".join(sorted(columns.keys() ^ self._layout.keys()))
            raise ValueError(f"the columns of a recording change: {odd}")
        rows = {}
        for name, column in self._layout.items():
            value = columns[name]
            if value.shape[1:] != column.shape:
                raise ValueError(
                    f"{name}: shape {value.shape[1:]} in a step, before {column.shape}"
                )
            rows[name] = value.astype(column.dtype)
        block = PendingSteps(len(self._episodes) - 1, self._step, count, rows)
        self._waiting.append(block)
        self._step += count
        self._count += count

    def _write_meta(self) -> None:
        columns = {name: column._asdict() for name, column in self._layout.items()}
        head = {**self._head, "columns": columns}
        draft = self.path / f"{META}.part"
        draft.write_text(json.dumps(head, indent=1, allow_nan=False) + "\n")
        with draft.open() as file:
            os.fsync(file.fileno())
        draft.replace(self.path / META)
