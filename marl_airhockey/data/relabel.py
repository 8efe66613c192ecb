"""Relabelling: recorded play as data of other tasks with the same bodies."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.recording import PLAYED, Columns, RecordedEpisode, Recording
from marl_airhockey.data.columns import (
    SHARED,
    episode_notes,
    first_columns,
    step_columns,
)
from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.data.record import AT_ONCE, write_episodes
from marl_airhockey.data.replay import Replay
from marl_airhockey.data.writer import RecordingWriter, whole_recording
from marl_airhockey.registry import make_scenario, scenario_names

LEFT_OUT = ("columns", "format", "observation_labels", *SHARED)
"""Keys of a head that are not those of the relabelled recording"""
CUT = "the recording ends here"
"""Reason of the end of an episode that its new rules would not have ended yet"""


def relabelled(
    path: Path, scenario: str, out: Path, options: dict[str, Any] | None = None
) -> Path:
    """Write a recording as if another scenario had been played.

    An episode begins as the recorded one and ends where the new rules end it, or with
    the recording.

    Args:
        path: Recording.
        scenario: Name of the new scenario.
        out: Folder of the new recording.
        options: Fields of the new scenario; its table and seats are those of the
            recorded one, unless they are given.

    Returns:
        ``out``.

    Raises:
        ValueError: The scenario has other bodies, or needs what was not recorded.
    """
    head = read_head(path)
    new = new_head(head, scenario, options or {})
    game = make_scenario(scenario, **new["options"])
    with whole_recording(out, new) as writer:
        for batch in batches(episodes_of(path)):
            _write(Recording(path, head, batch), game, writer)
    return out


def new_head(
    head: dict[str, Any], scenario: str, options: dict[str, Any]
) -> dict[str, Any]:
    """Return the head of a recording that is relabelled for a scenario.

    Args:
        head: Contents of its `meta.json`.
        scenario: Name of the new scenario.
        options: Fields of it, in addition to table and seats.

    Raises:
        ValueError: An unknown scenario or option.
    """
    chosen = {**_table_of(head), **options}
    game = make_scenario(scenario, **chosen)
    return {
        **{k: v for k, v in head.items() if k not in LEFT_OUT},
        "scenario": game.name,
        "options": chosen,
        "max_cycles": round(game.seconds / float(head["control_dt"])),
        "relabelled_from": head["scenario"],
    }


def _table_of(head: dict[str, Any]) -> dict[str, Any]:
    """Return the options that a recording shares with all scenarios at its table."""
    known = {**head.get("options", {}), **head}
    return {name: known[name] for name in ("table", "seats") if name in known}


def fitting(path: Path) -> list[str]:
    """Return the names of the scenarios that a recording can be relabelled for."""
    head = read_head(path)
    first = next((e for e in episodes_of(path) if len(e)), None)
    if first is None:
        return []
    recording, names = Recording(path, head, [first]), []
    for name in scenario_names():
        try:
            Replay(recording, make_scenario(name, **_table_of(head)))
        except ValueError:
            continue
        names.append(name)
    return names


def batches(episodes: Iterator[RecordedEpisode]) -> Iterator[list[RecordedEpisode]]:
    """Yield some episodes at a time; those without steps are left out."""
    whole = (episode for episode in episodes if len(episode))
    while batch := list(itertools.islice(whole, AT_ONCE)):
        yield batch


def _write(recording: Recording, game: Scenario, writer: RecordingWriter) -> None:
    """Write episodes, replayed side by side under the rules of a scenario."""
    replay = Replay(recording, game)
    replay.begin()
    world, count = replay.world, len(recording.episodes)
    first, notes = first_columns(world), [episode_notes(world, i) for i in range(count)]
    rows: list[Columns] = []
    lengths, done = replay.lengths.copy(), np.zeros(count, np.bool_)
    for t in range(int(replay.lengths.max())):
        result = replay.step(t)
        rows.append(step_columns(world))
        over = (result.terminated | result.truncated) & ~done
        lengths = np.where(over, np.minimum(lengths, t + 1), lengths)
        done |= over | (t + 1 >= replay.lengths)
        if done.all():
            break
    ends = [
        bool(rows[n - 1]["terminated"][i] | rows[n - 1]["truncated"][i])
        for i, n in enumerate(lengths)
    ]
    for i, n in enumerate(lengths):
        rows[n - 1]["truncated"][i] |= not ends[i]
    reasons = [PLAYED if ended else CUT for ended in ends]
    write_episodes(writer, first, rows, lengths, notes, reasons)
