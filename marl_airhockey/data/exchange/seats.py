"""Steps of seats in recordings, as other libraries store them."""

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
"""Parts of observations of goals="dict" """
OBSERVATION = "observation"
"""Name of the column of flat observations, and beginning of those of parts"""


def episodes_with_steps(
    files: Sequence[Path],
) -> Iterator[tuple[Path, Episode]]:
    """Yield the episodes of recordings, each with its recording's path.

    Raises:
        ValueError: There are no steps in them, or one makes no sense; named.
    """
    empty = True
    for path in files:
        for episode in episodes_of(path):
            if len(episode):
                empty = False
                yield path, episode
    if empty:
        raise ValueError(f"{files[0]}: there are no steps in it")


def observations_of(path: Path, episode: Episode) -> dict[str, Array]:
    """Return the observations (T + 1, seats, D) by part; of flat ones, the part is "".

    Raises:
        ValueError: Observations were not recorded.
    """
    names = [n for n in episode.first if n.split(".")[0] == OBSERVATION]
    if not names:
        raise ValueError(
            f"{path}: there are no observations in it; airhockey data relabel adds them"
        )
    return {name.partition(".")[2]: all_rows(episode, name) for name in names}


def all_rows(episode: Episode, name: str) -> Array:
    """Return a column (T + 1, ...) with its value before the first step.

    Raises:
        ValueError: It was not recorded.
    """
    if name not in episode.first or name not in episode.columns:
        raise ValueError(f"episode {episode.index}: {name} was not recorded")
    return np.concatenate([episode.first[name][None], episode.columns[name]])


def check_seat(episode: Episode, seat: int) -> None:
    """Refuse a seat that an episode does not have.

    Raises:
        ValueError: There is no such seat.
    """
    seats = episode.columns["action"].shape[1]
    if not 0 <= seat < seats:
        raise ValueError(f"--seat {seat}: the recording has {seats}")


def cut_off(episode: Episode) -> tuple[Array, Array]:
    """Return `terminated` and `truncated` (T,) of an episode.

    The last step of an interrupted episode is truncated.
    """
    ended = episode.columns["terminated"].astype(bool)
    truncated = episode.columns["truncated"].astype(bool)
    truncated[-1] |= not ended[-1]
    return ended, truncated


def playable(head: Mapping[str, Any]) -> dict[str, Any]:
    """Return keywords of an environment in which a recording could be made."""
    names = ("options", "profile", "observe", "control_dt", "goals")
    return {name: head[name] for name in names if head.get(name)}


def spaces_of(
    head: Mapping[str, Any], seat: int | None
) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Return the spaces of observations and actions.

    Args:
        head: Contents of a recording's `meta.json`.
        seat: Index of the seat; None for all, by agent.

    Raises:
        ValueError: There is no such seat.
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
    """Return the agent at a seat.

    Raises:
        ValueError: There is no such seat.
    """
    if not 0 <= seat < len(agents):
        raise ValueError(f"--seat {seat}: the scenario has {len(agents)}")
    return agents[seat]


def check_shapes(
    source: str, head: Mapping[str, Any], observation: Any, action: Any
) -> None:
    """Refuse a dataset whose spaces are not those of the scenario's first seat.

    Args:
        source: Name of the dataset.
        head: Contents of the new `meta.json`.
        observation: Shape of its observations; None for parts by name.
        action: Shape of its actions.

    Raises:
        ValueError: Another shape, named with that of the scenario.
    """
    shown, acted = spaces_of(head, 0)
    for what, own, other in (
        ("observations", shown.shape, observation),
        ("actions", acted.shape, action),
    ):
        if own != other:
            raise ValueError(
                f"{source}: its {what} have the shape {other}, those of "
                f"{head['scenario']} {own}; is it of another scenario, or of other "
                "options?"
            )
