"""Data with which a page shows a recorded episode."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.reader import read_recording
from marl_airhockey.play.messages import description, drawn, events
from marl_airhockey.rollouts.columns import memories_of, scenario_of, states_of
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.recording import Episode, Recording


def one_episode(path: Path, number: int = 0) -> Recording:
    """Read a recording and return it with one of its episodes only.

    Raises:
        ValueError: The path is not a recording, or the episode does not exist or has no
            steps.
    """
    recording = read_recording(path)
    if not 0 <= number < len(recording.episodes):
        raise ValueError(
            f"{path}: there is no episode {number}; it has {len(recording.episodes)}"
        )
    episode = recording.episodes[number]
    if not len(episode):
        raise ValueError(f"{path}: the episode has no steps")
    return replace(recording, episodes=[episode])


def replay_of(path: Path, number: int = 0) -> dict[str, Any]:
    """Return the data that a page needs to show an episode of a recording.

    ``meta`` describes the table and the players. ``steps`` are frames like those of a
    live match, with one before the first step. ``end`` has the reason for the end.

    Raises:
        ValueError: The path is not a recording, the episode does not exist, or it has
            another format.
    """
    recording = one_episode(path, number)
    (episode,), head = recording.episodes, recording.head
    scenario = scenario_of(recording)
    try:
        steps = frames_of(episode, scenario)
    except (ValueError, KeyError, IndexError) as error:
        raise ValueError(f"{path}: episode {number}: {error}") from error
    seconds = head["max_cycles"] * head["control_dt"]
    return {
        "meta": {
            "match": description(scenario, seconds),
            "control_dt": head["control_dt"],
            "players": _players(head),
        },
        "steps": steps,
        "end": {"reason": episode.reason, "steps": len(episode)},
    }


def _players(head: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of players; an empty list if they are invalid."""
    rows = head.get("players")
    listed = isinstance(rows, list) and all(isinstance(row, dict) for row in rows)
    return rows if isinstance(rows, list) and listed else []


def frames_of(episode: Episode, scenario: Scenario) -> list[dict[str, Any]]:
    """Return the T + 1 frames of an episode in the form of `LiveMatch.state`."""
    states, memories = states_of(episode, scenario), memories_of(episode)
    seats = len(scenario.scene.seats)
    none = np.zeros((1, seats))
    returns = np.concatenate([none, episode.columns["returns"]])
    success = np.concatenate([none, episode.columns["success"]]) > 0
    frames = []
    for n in range(len(episode) + 1):
        state = states.map(lambda x, n=n: x[n])  # type: ignore[misc]
        memory = {name: value[n] for name, value in memories.items()}
        row = drawn(scenario, state, memory, returns[n], success[n])
        notes = {
            **{"phase": "play", "n": n, "time_left": 0.0, "reason": ""},
            **{"golden_goal": False, "offers_golden_goal": False},
            **{"tally": None, "mixed": False},
        }
        frames.append({**notes, **row, "events": events(state) if n else []})
    return frames
