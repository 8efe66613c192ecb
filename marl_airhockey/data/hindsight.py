"""Hindsight relabelling of recordings (Andrychowicz et al., 2017).

An episode that missed its goal reached other goals. A copy of the episode gets one of
these goals. It ends where the goal is first reached, and is a success.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.data.relabel import batches, new_head
from marl_airhockey.data.writer import whole_recording
from marl_airhockey.registry import has_goals, make_scenario
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.sim.contracts.scenario import GoalScenario
from marl_airhockey.sim.core.recording import PLAYED, Columns, Episode, Recording
from marl_airhockey.types import Array

ACHIEVED, DESIRED = "observation.achieved_goal", "observation.desired_goal"
DROPPED = ("memory.", "term.")
"""Prefixes of the columns that depend on the original goal."""


def with_hindsight(
    path: Path, scenario: str, out: Path, copies: int = 4, seed: int = 0
) -> Path:
    """Write a recording as episodes of a goal task that reach their goals.

    Observations have the form of goals="dict". The goal of each copy of an episode is
    sampled uniformly from the goals that the episode reached.

    Args:
        path: Folder of the recording.
        scenario: Name of a task with goals and with the bodies of the recorded one.
        out: Folder of the new recording.
        copies: Number of copies of each episode.
        seed: Seed of the goals.

    Returns:
        ``out``.

    Raises:
        ValueError: The scenario has no goals or other bodies, or no goal was reached in
            the recording.
    """
    if not has_goals(scenario):
        raise ValueError(f"{scenario}: this scenario has no goals; remove --hindsight")
    head = read_head(path)
    new = new_head(head, scenario, {"goals": "dict"})
    game = make_scenario(scenario, **new["options"])
    assert isinstance(game, GoalScenario)
    rng = np.random.default_rng(seed)
    with whole_recording(out, {**new, "hindsight": copies}) as writer:
        for batch in batches(episodes_of(path)):
            replay = Replay(Recording(path, head, batch), game)
            for episode in replay.episodes():
                for _ in range(copies):
                    found = _copy(game, episode, rng)
                    if found is not None:
                        writer.write(found)
        if not writer.episodes:
            raise ValueError(f"{path}: no episode reached a goal of {scenario}")
    return out


def _copy(
    game: GoalScenario, episode: Episode, rng: np.random.Generator
) -> Episode | None:
    """Return an episode with another goal; None if it reached no goal.

    A goal must not be met at the start, and it must be a goal that can be met.
    """
    first, columns = _without_goal(episode.first), _without_goal(episode.columns)
    start, achieved = first[ACHIEVED][0], columns[ACHIEVED][:, 0]
    fits = game.goal_reward(achieved, achieved) > 0
    fits &= game.goal_reward(np.broadcast_to(start, achieved.shape), achieved) == 0
    if not fits.any():
        return None
    goal = achieved[rng.choice(np.flatnonzero(fits))]
    met = game.goal_reward(achieved, np.broadcast_to(goal, achieved.shape)) > 0
    end = int(np.argmax(met)) + 1
    columns = {
        **{name: values[:end] for name, values in columns.items()},
        DESIRED: _as(goal, columns[DESIRED][:end]),
        **_ends(met[:end]),
    }
    first[DESIRED] = _as(goal, first[DESIRED])
    return replace(episode, first=first, columns=columns, reason=PLAYED)


def _without_goal(columns: Columns) -> Columns:
    return {n: value for n, value in columns.items() if not n.startswith(DROPPED)}


def _as(goal: Array, like: Array) -> Array:
    return np.broadcast_to(goal, like.shape).astype(like.dtype)


def _ends(met: Array) -> dict[str, Any]:
    """Return rewards (T, 1) and ends (T,) of an episode that meets its goal last."""
    reward = met.astype(np.float64)[:, None]
    return {
        "reward": reward,
        "returns": np.cumsum(reward, axis=0),
        "success": met[:, None],
        "terminated": met,
        "truncated": np.zeros(len(met), np.bool_),
    }
