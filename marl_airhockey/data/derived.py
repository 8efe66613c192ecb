"""Repairing, merging, splitting and resuming of recordings."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.files import shared_head
from marl_airhockey.data.parquet import read_table, write_table
from marl_airhockey.data.parts import parts_of
from marl_airhockey.data.reader import (
    episodes_of,
    missing_steps,
    read_episode_rows,
    read_head,
    step_counts,
)
from marl_airhockey.data.writer import RecordingWriter, whole_recording

PASSING = ("began", "versions", "columns", "format", "observation_labels")
"""Keys of the metadata that may differ when a recording is resumed."""


def repaired(path: Path, out: Path) -> list[str]:
    """Write the intact episodes of a recording as a new one; return the faults.

    Raises:
        ValueError: The metadata or all episodes cannot be read, or the folder ``out``
            exists.
    """
    head, wrong, cut = read_head(path), list[str](), dict[int, str]()
    with suppress(ValueError):  # `episodes_of` reports a file that cannot be read.
        cut = missing_steps(path)
    with whole_recording(out, head) as writer:
        for episode in episodes_of(path, bad=wrong):
            if episode.index not in cut:
                writer.write(episode)
        wrong += cut.values()
        if not writer.episodes:
            words = "; ".join(wrong)
            raise ValueError(f"{path}: no episode can be read: {words}")
    return wrong


def merged(paths: Sequence[Path], out: Path) -> None:
    """Write recordings of the same environment as one recording.

    Raises:
        ValueError: The recordings have different environments, or one is damaged.
    """
    head, seats = shared_head(paths), [read_head(p).get("players", []) for p in paths]
    players = [_together(seat) for seat in zip(*seats, strict=True)]
    with whole_recording(out, {**head, "players": players}) as writer:
        for path in paths:
            for episode in episodes_of(path):
                writer.write(episode)


def _together(players: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the description of a seat in which several players played."""
    names = {name: [player[name] for player in players] for name in players[0]}
    return {
        name: values[0]
        if all(value == values[0] for value in values)
        else " + ".join(dict.fromkeys(str(value) for value in values if value))
        for name, values in names.items()
    }


def divided(path: Path, out: Path, share: float, seed: int) -> list[Path]:
    """Split a recording at random into `train` and `test`; return both paths.

    Raises:
        ValueError: One of them would have no episode, or the recording is damaged.
    """
    head, count = read_head(path), len(read_episode_rows(path))
    tested = round(share * count) if 0.0 < share < 1.0 else 0
    if not 0 < tested < count:
        raise ValueError(
            f"--test {share}: {tested} of {count} episodes; expected at least one "
            "episode for train and one for test"
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
        head: Metadata of the recording as it is made now.

    Raises:
        ValueError: The metadata differ from those of the recording.
        RuntimeError: Another process writes the recording.
    """
    known = read_head(path)
    for name in dict.fromkeys((*head, *known)):
        if name in PASSING:
            continue
        # Compare values after a round trip through JSON, which turns tuples into lists.
        now, before = json.loads(json.dumps(head.get(name))), known.get(name)
        if now != before:
            raise ValueError(
                f"{path}: it was recorded with {name} {before!r}, not {now!r}; "
                "give another folder"
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
