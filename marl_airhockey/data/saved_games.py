"""Import of games that the page without a server has saved.

The file has two lines. The first one is JSON: ``format`` (`FORMAT`), ``scenario``,
``control_dt``, ``players``, ``episodes`` (rows with ``seed``, ``steps`` and ``reason``
for the end), and ``actions``, base64 of float32 (steps of all episodes, seats, 2), ego
frames, in top speeds. The second line is the SHA-256 of the first line and of the
numbers of every step: position, velocity, angle, spin and reward, float64.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.data.writer import whole_recording
from marl_airhockey.rollouts.columns import (
    episode_notes,
    first_columns,
    head_of,
    of_single_world,
    step_columns,
)
from marl_airhockey.sim.core.recording import PLAYED
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

SUFFIX = ".airhockey"
FORMAT = "airhockey-games-1"
LARGEST = 64_000_000
"""Largest size of a file, bytes."""


class SavedEpisode(NamedTuple):
    """Episode of a file."""

    seed: int
    reason: str
    actions: Array
    """Actions (steps, seats, 2), in top speeds, ego frames."""


@dataclass(frozen=True)
class SavedGames:
    """Content of a file."""

    scenario: str
    control_dt: float
    players: list[dict[str, Any]]
    episodes: list[SavedEpisode]
    line: str
    """First line of the file."""
    hash: str
    """SHA-256 in the file."""

    @staticmethod
    def read(path: Path) -> SavedGames:
        """Read a file.

        Raises:
            ValueError: The file cannot be read, or has another content.
        """
        try:
            if path.stat().st_size > LARGEST:
                raise ValueError("it is too large")
            line, digest = path.read_text("utf-8").split("\n")[:2]
            head = json.loads(line)
            if head["format"] != FORMAT:
                raise ValueError(f"its format is {head['format']!r}, not {FORMAT!r}")
            players = [_player(row) for row in head["players"]]
            episodes = _episodes(head["episodes"], head["actions"], len(players))
            dt = float(head["control_dt"])
            return SavedGames(
                str(head["scenario"]), dt, players, episodes, line, digest
            )
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror}") from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{path}: this is not a saved game: {error}") from error


def import_games(path: Path, out: Path) -> Path:
    """Play saved games again and write them as a recording; return ``out``.

    Raises:
        ValueError: The file contains no saved games, ``out`` exists, or the hash of the
            file differs from the hash of this replay.
    """
    games = SavedGames.read(path)
    keywords = Keywords(control_dt=games.control_dt)
    world = build_world(games.scenario, 1, False, keywords)
    try:
        if len(world.scene.seats) != len(games.players):
            raise ValueError(f"{path}: {len(games.players)} players do not fit")
        digest = hashlib.sha256(games.line.encode())
        head = {**head_of(world, keywords), "players": games.players}
        with whole_recording(out, head) as writer:
            for episode in games.episodes:
                world.reset(seed=episode.seed)
                writer.begin(
                    of_single_world(first_columns(world)), *episode_notes(world)
                )
                reason = episode.reason
                for numbers, over in _played(world, episode.actions):
                    digest.update(numbers.tobytes())
                    writer.add(of_single_world(step_columns(world)))
                    reason = PLAYED if over else reason
                writer.end(reason)
            if digest.hexdigest() != games.hash:
                raise ValueError(
                    f"{path}: the hash of the replay differs from the hash in the "
                    "file; it was changed, or another version has saved it"
                )
    finally:
        world.close()
    return out


def _played(world: World, actions: Array) -> Iterator[tuple[Array, bool]]:
    """Yield the numbers of each step, and True if the episode ends with it."""
    for row in actions:
        result = world.step(row[None])
        state = world.state
        parts = state.position, state.velocity, state.angle, state.spin
        numbers = [*parts, world.outcome["reward"]]
        over = bool(result.terminated[0] or result.truncated[0])
        # Adding 0 removes the sign of zeros.
        yield np.concatenate([np.ravel(n) for n in numbers]) + 0.0, over
        if over:
            return


def _episodes(rows: list[dict[str, Any]], text: str, seats: int) -> list[SavedEpisode]:
    actions = np.frombuffer(base64.b64decode(text, validate=True), np.float32)
    actions = actions.reshape(-1, seats, 2).astype(np.float64)
    steps = [int(row["steps"]) for row in rows]
    if min(steps, default=0) < 1 or sum(steps) != len(actions):
        raise ValueError(f"{len(actions)} actions for episodes of {steps} steps")
    if not np.isfinite(actions).all():
        raise ValueError("its actions must be finite numbers")
    parts = np.split(actions, np.cumsum(steps)[:-1])
    return [
        SavedEpisode(int(row["seed"]), str(row["reason"])[:200], part)
        for row, part in zip(rows, parts, strict=True)
    ]


def _player(row: dict[str, Any]) -> dict[str, Any]:
    """Return the metadata of a player."""
    person, handicap = row["person"], row["handicap"]
    return {
        "driver": str(row["driver"])[:200],
        "handicap": {str(k): float(v) for k, v in handicap.items()},
        "person": None if person is None else str(person)[:200],
    }
