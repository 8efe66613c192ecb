"""Observations, actions and spaces of seats, in the form of other libraries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from marl_airhockey.data.reader import episodes_of
from marl_airhockey.make import parallel_env
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.types import Array

GOALS = ("observation", "achieved_goal", "desired_goal")
"""Parts of observations with goals="dict"."""
OBSERVATION = "observation"
"""Column of flat observations, and prefix of the columns of parts."""


def episodes_with_steps(
    files: Sequence[Path],
) -> Iterator[tuple[Path, Episode]]:
    """Yield the path of the recording and each episode that has steps.

    Raises:
        ValueError: There are no steps, or a recording is damaged.
    """
    empty = True
    for path in files:
        for episode in episodes_of(path):
            if len(episode):
                empty = False
                yield path, episode
    if empty:
        raise ValueError(f"{files[0]}: it contains no steps")


def observations_of(path: Path, episode: Episode) -> dict[str, Array]:
    """Return observations (T + 1, seats, D) by part; flat ones have the part "".

    Raises:
        ValueError: Observations were not recorded.
    """
    names = [n for n in episode.first if n.split(".")[0] == OBSERVATION]
    if not names:
        raise ValueError(
            f"{path}: it contains no observations; airhockey data relabel adds them"
        )
    return {name.partition(".")[2]: all_rows(episode, name) for name in names}


def all_rows(episode: Episode, name: str) -> Array:
    """Return a column (T + 1, ...) that starts with its value before the first step.

    Raises:
        ValueError: The column was not recorded.
    """
    if name not in episode.first or name not in episode.columns:
        raise ValueError(f"episode {episode.index}: {name} was not recorded")
    return np.concatenate([episode.first[name][None], episode.columns[name]])


def check_seat(episode: Episode, seat: int) -> None:
    """Check that an episode has a seat.

    Raises:
        ValueError: The seat does not exist.
    """
    seats = episode.columns["action"].shape[1]
    if not 0 <= seat < seats:
        raise ValueError(f"--seat {seat}: the recording has {seats} seats, from 0")


def cut_off(episode: Episode) -> tuple[Array, Array]:
    """Return `terminated` and `truncated` (T,) of an episode.

    The last step of an interrupted episode is truncated.
    """
    ended = episode.columns["terminated"].astype(bool)
    truncated = episode.columns["truncated"].astype(bool)
    truncated[-1] |= not ended[-1]
    return ended, truncated


def playable(head: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords of the environment of a recording."""
    names = ("options", "profile", "observe", "control_dt", "goals")
    return {name: head[name] for name in names if head.get(name)}


def spaces_of(
    head: Mapping[str, Any], seat: int | None
) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Return the spaces of observations and actions.

    Args:
        head: Metadata of a recording.
        seat: Index of the seat; None for all seats, by agent.

    Raises:
        ValueError: The seat does not exist.
    """
    env = parallel_env(head["scenario"], **playable(head))
    agents = list(env.possible_agents)
    seen = {agent: env.observation_space(agent) for agent in agents}
    done = {agent: env.action_space(agent) for agent in agents}
    env.close()
    if seat is None:
        return spaces.Dict(seen), spaces.Dict(done)
    agent = agent_at(agents, seat)
    return seen[agent], done[agent]


def agent_at(agents: Sequence[str], seat: int) -> str:
    """Return the agent of a seat.

    Raises:
        ValueError: The seat does not exist.
    """
    if not 0 <= seat < len(agents):
        raise ValueError(f"--seat {seat}: the scenario has {len(agents)} seats, from 0")
    return agents[seat]


def check_shapes(
    source: str, head: Mapping[str, Any], observation: Any, action: Any
) -> None:
    """Check that a dataset has the spaces of the scenario's first seat.

    Args:
        source: Name of the dataset.
        head: Metadata of the new recording.
        observation: Shape of the observations; None for parts by name.
        action: Shape of the actions.

    Raises:
        ValueError: A shape differs from that of the scenario.
    """
    shown, acted = spaces_of(head, 0)
    for what, own, other in (
        ("observations", shown.shape, observation),
        ("actions", acted.shape, action),
    ):
        if own != other:
            raise ValueError(
                f"{source}: its {what} have the shape {other}, but {head['scenario']} "
                f"has {own}; check the scenario and its options"
            )
