"""Writer of recordings; flushed steps survive the end of the process."""

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
"""Longest time between two flushes to the disk, s."""
PART = 16_384
"""Largest number of steps in memory before a flush."""


@contextmanager
def whole_recording(path: Path, head: Mapping[str, Any]) -> Iterator[RecordingWriter]:
    """Yield the writer of a new recording, which is deleted after any error.

    Args:
        path: Folder of the recording, which must not exist.
        head: Metadata; the description of columns is replaced.

    Raises:
        ValueError: The folder exists or cannot be created.
    """
    with parent_of(path):
        try:
            writer = RecordingWriter(path, {**head, "columns": {}})
        except FileExistsError as error:
            raise ValueError(f"{path}: the folder exists; give another") from error
        except OSError as error:
            raise ValueError(f"{path}: cannot be created: {error.strerror}") from error
        try:
            with writer:
                yield writer
        except BaseException:
            shutil.rmtree(path, ignore_errors=True)
            raise


class RecordingWriter:
    """Writer of a recording.

    A separate thread writes to the disk, so that `add` and `end` return immediately.

    Args:
        path: Folder of the recording, which must not exist.
        head: Metadata that can be written as JSON.

    Raises:
        FileExistsError: The folder exists.
        OSError: The folder cannot be created.
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
            head: Metadata of the recording.
            episodes: Rows of its `episodes.parquet`.

        Raises:
            RuntimeError: Another process writes the recording.
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
        # The first calls of pyarrow take half a second in total.
        warm_up()
        self._disk = DiskWriter(path, part)
        self._flushed, self._changed = time.monotonic(), False

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def episodes(self) -> int:
        """Number of episodes that have started."""
        return len(self._episodes)

    def begin(
        self,
        first: Columns,
        seed: int | None = None,
        number: int = 0,
        physics: Mapping[str, float] | None = None,
    ) -> None:
        """Start the next episode.

        Args:
            first: Values before the first step, by column.
            seed: Seed of the world.
            number: Number of the episode since the world was seeded.
            physics: Physics parameters of the episode.
        """
        self._place_first()
        own = {f"{PHYSICS}{k}": float(v) for k, v in (physics or {}).items()}
        row = {"episode": len(self._episodes), "seed": seed, "number": number}
        ends = {"length": 0, "returns": [], "success": [], "reason": ""}
        self._episodes.append({**row, **ends, **own})
        self._first = {n: np.array(value)[None] for n, value in first.items()}
        self._step, self._changed = 0, True

    def add(self, row: Columns) -> None:
        """Add a control step; it is on the disk within a second."""
        self.add_rows({name: np.array(value)[None] for name, value in row.items()})
        self._flush_in_time()

    def add_rows(self, columns: Columns) -> None:
        """Add control steps, arrays (T, ...).

        Raises:
            ValueError: The columns differ from those of previous steps.
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
        """End the episode and store the reason."""
        self._place_first()
        self._episodes[-1]["reason"], self._changed = reason, True
        self._flush_in_time()

    def write(self, episode: Episode) -> None:
        """Write a complete episode, or one without a reason as interrupted."""
        self.begin(episode.first, episode.seed, episode.number, episode.physics)
        if len(episode):
            self.add_rows(episode.columns)
        if episode.reason:
            self.end(episode.reason)

    def _flush_in_time(self) -> None:
        """Start a flush in the thread if it is due, without waiting for it."""
        written = self._collect(wait=False)
        if written and time.monotonic() - self._flushed > FLUSH:
            self._flushed = time.monotonic()
            episodes = [dict(row) for row in self._episodes] if self._changed else []
            self._changed, blocks = False, self._waiting[:]
            self._disk.start(episodes, blocks, self._layout)

    def _collect(self, wait: bool) -> bool:
        """Return True if the thread has completed the last flush.

        Args:
            wait: True to wait for the thread.

        Raises:
            OSError: The flush failed; its steps are still in memory.
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
        """Write all steps in memory to the disk."""
        self._collect(wait=True)
        self._flushed = 0.0
        self._flush_in_time()
        self._collect(wait=True)

    def close(self) -> None:
        """Write all steps, merge small parts, and close the recording."""
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
            with suppress(OSError):  # Windows does not delete open files.
                (self.path / ".lock").unlink()
            self._lock.release()

    def _place_first(self, columns: Columns | None = None) -> None:
        """Add the values before the first step as step 0.

        This waits for the first step, because it defines the columns of a recording.
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
        """Store steps in memory until the next flush."""
        if columns.keys() != self._layout.keys():
            odd = ", ".join(sorted(columns.keys() ^ self._layout.keys()))
            raise ValueError(
                f"columns {odd}: expected the same columns in all steps of a recording"
            )
        rows = {}
        for name, column in self._layout.items():
            value = columns[name]
            if value.shape[1:] != column.shape:
                raise ValueError(
                    f"{name}: shape {value.shape[1:]}; expected {column.shape}"
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
