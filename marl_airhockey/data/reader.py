"""Reader of recordings, one episode at a time."""

from __future__ import annotations

import itertools
import json
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.parquet import KEYS, columns_of, read_table
from marl_airhockey.data.parts import parts_of
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.recording import (
    EPISODES,
    FINITE,
    FORMAT,
    META,
    PHYSICS,
    Column,
    Columns,
    Episode,
    Recording,
)
from marl_airhockey.types import Array

LARGEST_META = 1 << 24
"""Largest size of `meta.json`, bytes."""
NEEDED = ("episode", "length", "reason")
"""Columns that a table of episodes must have."""


def read_head(path: Path) -> dict[str, Any]:
    """Return the metadata of a recording, the contents of its `meta.json`.

    Raises:
        ValueError: The folder is not a recording, or has another format.
    """
    file = path / META
    try:
        if file.stat().st_size > LARGEST_META:
            raise ValueError(f"{file}: it is larger than {LARGEST_META} bytes")
        head = json.loads(file.read_text())
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be read as a recording: {error.strerror}"
        ) from error
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"{file}: not a recording of marl_airhockey") from error
    if not isinstance(head, dict) or "format" not in head:
        raise ValueError(f"{file}: not a recording of marl_airhockey")
    found, dt = head["format"], head.get("control_dt")
    if found != FORMAT:
        raise ValueError(
            f"{path}: recorded by another version of marl_airhockey (format {found}); "
            f"this version reads format {FORMAT}"
        )
    if not isinstance(head.get("scenario"), str):
        raise ValueError(f"{path}: its meta.json has no scenario")
    if not (isinstance(dt, (int, float)) and 0.0 < dt < float("inf")):
        raise ValueError(f"{path}: control_dt {dt!r}; expected a time above 0 s")
    if not isinstance(head.get("columns"), dict):
        raise ValueError(f"{path}: its meta.json has no columns")
    return head


def read_episode_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of `episodes.parquet`; an empty list without this file.

    Raises:
        ValueError: The file cannot be read, or its episodes are not in order.
    """
    file = path / EPISODES
    if not file.exists():
        return []
    rows: list[dict[str, Any]] = read_table(file).to_pylist()
    for k, row in enumerate(rows):
        if any(row.get(name) is None for name in NEEDED) or row["episode"] != k:
            raise ValueError(f"{file}: row {k} is not episode {k}")
    return rows


def missing_steps(path: Path) -> dict[int, str]:
    """Return messages about missing steps at the ends of episodes, by index.

    An episode whose recording was interrupted has no missing steps. `episodes_of`
    reports an episode without any step that is followed by others.

    Raises:
        ValueError: A part cannot be read.
    """
    rows = read_episode_rows(path)
    counts = step_counts(path, len(rows))
    last = int(np.flatnonzero(counts)[-1]) if counts.any() else -1
    return {
        k: f"{path}: episode {k}: {rows[k]['length'] - counts[k]} of its "
        f"{rows[k]['length']} steps are missing at the end"
        for k in range(len(rows))
        if rows[k]["reason"] and counts[k] < rows[k]["length"]
        if counts[k] or k > last
    }


def step_counts(path: Path, episodes: int) -> Array:
    """Return the number of existing steps of each episode.

    Raises:
        ValueError: A part cannot be read.
    """
    last = np.zeros(episodes, np.int64)
    for part in parts_of(path):
        keys = columns_of(
            read_table(part, KEYS), dict.fromkeys(KEYS, Column("int32", ()))
        )
        known = keys["episode"] < episodes
        np.maximum.at(last, keys["episode"][known], keys["step"][known])
    return last


def read_recording(path: str | Path) -> Recording:
    """Read a recording.

    Raises:
        ValueError: The folder is not a recording, has another format, or is damaged.
    """
    path = Path(path)
    return Recording(path, read_head(path), list(episodes_of(path)))


def episodes_of(
    path: str | Path,
    names: Collection[str] | None = None,
    bad: list[str] | None = None,
) -> Iterator[Episode]:
    """Yield the episodes of a recording, with one at a time in memory.

    Args:
        path: Folder of the recording.
        names: Names of the columns to read, some of which may be missing; None for all.
        bad: List to which faults are appended, while intact episodes are still read;
            None to raise an error instead.

    Raises:
        ValueError: The recording is damaged, or none of the columns exists.
    """
    path = Path(path)
    head, rows = read_head(path), read_episode_rows(path)
    layout = _layout(path, head, names)
    pieces: _Pieces | None = None
    due = 0
    for part in parts_of(path):
        try:
            found = _steps_of(part, layout)
        except ValueError as error:
            _complain(str(error), bad)
            continue
        for piece in found:
            if pieces is not None and piece.episode > pieces.episode:
                yield from _joined(path, pieces, rows, layout, bad)
                due, pieces = pieces.episode + 1, None
            if pieces is None and piece.episode >= due:
                for k in range(due, min(piece.episode, len(rows))):
                    if rows[k]["reason"]:
                        _complain(f"{path}: episode {k}: its steps are missing", bad)
                pieces = _Pieces(piece.episode)
            if pieces is not None and piece.episode == pieces.episode:
                pieces.add(piece)
    if pieces is not None:
        yield from _joined(path, pieces, rows, layout, bad)


def _layout(
    path: Path, head: dict[str, Any], names: Collection[str] | None
) -> dict[str, Column]:
    """Return the columns to read, by name.

    Raises:
        ValueError: The description of the columns is damaged, or none of them exists.
    """
    known = head["columns"]
    if names and known and not known.keys() & {*names}:
        raise ValueError(f"{path}: {unknown_name('column', next(iter(names)), known)}")
    try:
        return {
            name: Column.from_fields(name, fields)
            for name, fields in known.items()
            if names is None or name in names
        }
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


@dataclass
class _Piece:
    """Steps of an episode in one part."""

    episode: int
    first: int
    count: int
    columns: Columns


@dataclass
class _Pieces:
    """Steps of an episode that have been read."""

    episode: int
    columns: list[Columns] = field(default_factory=list)
    next: int = 0
    gap: str = ""

    def add(self, piece: _Piece) -> None:
        """Add steps, except for those that were already added."""
        again = self.next - piece.first
        if again < 0:
            self.gap = self.gap or f"steps {self.next} to {piece.first - 1} are missing"
        if again < piece.count:
            kept = {n: v[max(again, 0) :] for n, v in piece.columns.items()}
            self.columns.append(kept)
            self.next = piece.first + piece.count


def _complain(words: str, bad: list[str] | None) -> None:
    if bad is None:
        raise ValueError(words)
    bad.append(words)


def _steps_of(part: Path, layout: dict[str, Column]) -> list[_Piece]:
    """Return the steps in a part, by episode.

    Raises:
        ValueError: The file is damaged.
    """
    table = read_table(part, [*KEYS, *layout])
    keys = {name: Column("int32", ()) for name in KEYS}
    try:
        numbers, columns = columns_of(table, keys), columns_of(table, layout)
    except ValueError as error:
        raise ValueError(f"{part}: {error}") from error
    episode, step = numbers["episode"], numbers["step"]
    if not len(episode):
        return []
    cuts = np.flatnonzero(np.diff(episode) != 0) + 1
    edges = [0, *cuts.tolist(), len(episode)]
    pieces = []
    for start, stop in itertools.pairwise(edges):
        if (np.diff(step[start:stop]) != 1).any() or step[start] < 0:
            raise ValueError(
                f"{part}: the steps of episode {episode[start]} are not consecutive"
            )
        own = {name: values[start:stop] for name, values in columns.items()}
        pieces.append(_Piece(int(episode[start]), int(step[start]), stop - start, own))
    return pieces


def _joined(
    path: Path,
    pieces: _Pieces,
    rows: list[dict[str, Any]],
    layout: dict[str, Column],
    bad: list[str] | None,
) -> Iterator[Episode]:
    """Yield an episode if it is intact."""
    where, whole = f"{path}: episode {pieces.episode}", {}
    if pieces.episode >= len(rows) or pieces.gap:
        words = pieces.gap or f"it is missing in {EPISODES}"
        return _complain(f"{where}: {words}", bad)
    for name in layout:
        whole[name] = np.concatenate([columns[name] for columns in pieces.columns])
        lacks = np.flatnonzero(
            ~np.isfinite(whole[name]).reshape(pieces.next, -1).all(1)
        )
        # There is no action before the first step.
        lacks = lacks[lacks >= (not name.startswith(("state.", "observation")))]
        if name in FINITE and lacks.size:
            words = f"{where}: {name} is not finite at step {lacks[0]}"
            return _complain(words, bad)
    row = rows[pieces.episode]
    complete = row["length"] == pieces.next - 1
    yield Episode(
        index=pieces.episode,
        seed=row.get("seed"),
        number=row.get("number") or 0,
        physics={
            name.removeprefix(PHYSICS): value
            for name, value in row.items()
            if name.startswith(PHYSICS) and value is not None
        },
        reason=row["reason"] if complete else "",
        first={name: values[0] for name, values in whole.items()},
        columns={name: values[1:] for name, values in whole.items()},
    )
