"""Relabelling of recordings for other scenarios with the same bodies."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.data.writer import whole_recording
from marl_airhockey.registry import make_scenario, scenario_names
from marl_airhockey.rollouts.columns import SHARED
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.rollouts.rollout import AT_ONCE
from marl_airhockey.sim.contracts.image_form import shows_images
from marl_airhockey.sim.core.recording import PLAYED, Episode, Recording

LEFT_OUT = ("columns", "format", "observation_labels", *SHARED)
"""Keys of the metadata that are not copied to the relabelled recording."""
CUT = "the recording ends here"
"""Reason for the end of an episode that the new rules do not end."""


def relabelled(
    path: Path, scenario: str, out: Path, options: dict[str, Any] | None = None
) -> Path:
    """Write a recording as if another scenario had been played.

    An episode starts like the recorded one. It ends where the new rules end it, or at
    the end of the recorded one.

    Args:
        path: Folder of the recording.
        scenario: Name of the new scenario.
        out: Folder of the new recording.
        options: Options of the new scenario; by default its table and seats are those
            of the recorded one.

    Returns:
        ``out``.

    Raises:
        ValueError: The scenario has other bodies, or needs values that were not
            recorded.
    """
    head = read_head(path)
    new = new_head(head, scenario, options or {})
    game = make_scenario(scenario, **new["options"])
    with whole_recording(out, new) as writer:
        for batch in batches(episodes_of(path)):
            recording = Recording(path, head, batch)
            for episode in Replay(recording, game, new["observe"]).episodes():
                writer.write(_cut(episode))
    return out


def new_head(
    head: dict[str, Any], scenario: str, options: dict[str, Any]
) -> dict[str, Any]:
    """Return the metadata of a recording that is relabelled for a scenario.

    Args:
        head: Metadata of the original recording.
        scenario: Name of the new scenario.
        options: Options of the new scenario, in addition to table and seats.

    Raises:
        ValueError: The scenario or an option does not exist.
    """
    chosen = {**_table_of(head), **options}
    game = make_scenario(scenario, **chosen)
    observe = head.get("observe", "velocity")
    return {
        **{k: v for k, v in head.items() if k not in LEFT_OUT},
        # Images are not stored.
        "observe": "velocity" if shows_images(observe) else observe,
        "scenario": game.name,
        "options": chosen,
        "max_cycles": round(game.seconds / float(head["control_dt"])),
        "relabelled_from": head["scenario"],
    }


def _table_of(head: dict[str, Any]) -> dict[str, Any]:
    """Return the options of a recording that do not depend on its scenario."""
    known = {**head.get("options", {}), **head}
    return {name: known[name] for name in ("table", "seats") if name in known}


def fitting(path: Path) -> list[str]:
    """Return the names of the scenarios for which a recording can be relabelled."""
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


def batches(episodes: Iterator[Episode]) -> Iterator[list[Episode]]:
    """Yield batches of episodes, without those that have no steps."""
    whole = (episode for episode in episodes if len(episode))
    while batch := list(itertools.islice(whole, AT_ONCE)):
        yield batch


def _cut(episode: Episode) -> Episode:
    """Return a replayed episode up to the end that its scenario defines."""
    columns = episode.columns
    ends = columns["terminated"] | columns["truncated"]
    ended, length = bool(ends.any()), len(episode)
    if ended:
        length = int(ends.argmax()) + 1
    columns = {name: value[:length] for name, value in columns.items()}
    columns["truncated"][-1] |= not ended
    return replace(episode, columns=columns, reason=PLAYED if ended else CUT)
