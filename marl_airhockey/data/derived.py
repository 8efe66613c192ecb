"""Recordings made of recordings: repaired, merged, divided, resumed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from marl_airhockey.data.files import shared_head
from marl_airhockey.data.parquet import read_table, write_table
from marl_airhockey.data.parts import parts_of
from marl_airhockey.data.reader import (
    episodes_of,
    read_episode_rows,
    read_head,
    step_counts,
)
from marl_airhockey.data.writer import RecordingWriter, whole_recording

PASSING = ("began", "versions", "columns", "format", "observation_labels")
"""Keys of a head that may differ where a recording is resumed"""


def repaired(path: Path, out: Path) -> list[str]:
    """Write the good episodes of a recording as a new one; return what was wrong.

    Raises:
        ValueError: Not even its head can be read, or no episode, or there is such a
            folder as ``out``.
    """
    head, wrong = read_head(path), list[str]()
    with whole_recording(out, head) as writer:
        for episode in episodes_of(path, bad=wrong):
            writer.write(episode)
        if not writer.episodes:
            words = "; ".join(wrong)
            raise ValueError(f"{path}: no episode of it can be read: {words}")
    return wrong


def merged(paths: Sequence[Path], out: Path) -> None:
    """Write recordings of one kind as one.

    Raises:
        ValueError: Recordings that differ, or one that makes no sense; named.
    """
    head = shared_head(paths)
    with whole_recording(out, head) as writer:
        for path in paths:
            for episode in episodes_of(path):
                writer.write(episode)


def divided(path: Path, out: Path, share: float, seed: int) -> list[Path]:
    """Write the episodes of a recording as two, `train` and `test`; return both.

    Raises:
        ValueError: Not at least one episode for each, or a recording that makes no
            sense; named.
    """
    head, count = read_head(path), len(read_episode_rows(path))
    tested = round(share * count)
    if not 0 < tested < count:
        raise ValueError(
            f"--test {share}: {tested} of the {count} episodes; expected at least one "
            "for train and one for test"
        )
    drawn = np.random.default_rng(seed).permutation(count)[:tested]
    paths = [out / "train", out / "test"]
    new = (whole_recording(part, head) for part in paths)
    with next(new) as train, next(new) as test:
        for episode in episodes_of(path):
            (test if episode.index in drawn else train).write(episode)
    return paths


def resume(path: Path, head: dict[str, object]) -> RecordingWriter:
    """Return a writer that resumes an interrupted recording.

    Episodes that are not complete are deleted.

    Args:
        path: Folder of the recording.
        head: Head with which the recording is made now.

    Raises:
        ValueError: It was made with another head; what differs is named.
        RuntimeError: Another process writes it.
    """
    known = read_head(path)
    for name in dict.fromkeys((*head, *known)):
        if name in PASSING:
            continue
        # As it looks after JSON: tuples are lists there.
        now, before = json.loads(json.dumps(head.get(name))), known.get(name)
        if now != before:
            raise ValueError(
                f"{path}: it was recorded with {name} {before!r}, not {now!r}; "
                "name another folder"
            )
    rows = read_episode_rows(path)
    counts = step_counts(path, len(rows))
    whole = [
        bool(r["reason"]) and r["length"] == n
        for r, n in zip(rows, counts, strict=True)
    ]
    kept = int(np.argmin([*whole, False]))
    writer = RecordingWriter.extend(path, known, rows[:kept])
    for part in parts_of(path):
        table = read_table(part)
        good = table["episode"].to_numpy() < kept
        if not good.any():
            part.unlink()
        elif not good.all():
            write_table(table.filter(good), part)
    return writer
