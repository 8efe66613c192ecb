"""Arrays of states and commands, from a world or from recordings.

`system_id.system_id` fits physics parameters to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from marl_airhockey.build import build_driven_world
from marl_airhockey.data.reader import read_recording
from marl_airhockey.rollouts.columns import scenario_of
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.core.recording import Columns
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

JUMP_SLACK = 0.5
"""Excess of a body's mean speed in a step over its speeds before and after it, m/s,
above which the physics has not moved it: it was served or placed by hand."""


@dataclass(frozen=True)
class RecordedPlay:
    """Rows of T control steps in one scene, one episode after the other."""

    scene: Scene
    control_dt: float
    position: Array
    """Positions (T, N, 2) after each step, m."""
    velocity: Array
    """Velocities (T, N, 2) after each step, m/s."""
    command: Array
    """Commands (T, seats, 2) of the step that led to the state, m/s."""
    follows: Array
    """True where a row is one step after the previous row, bool (T,)."""

    def segment_starts(self, steps: int) -> Array:
        """Return the first rows (W,) of segments of ``steps`` steps without overlap.

        A row in which a body has jumped, such as a served puck, follows no other.
        """
        moved = np.diff(self.position, axis=0, prepend=self.position[:1])
        distance = np.hypot(moved[..., 0], moved[..., 1])
        speed = np.hypot(self.velocity[..., 0], self.velocity[..., 1])
        most = np.maximum(speed, np.roll(speed, 1, axis=0)) + JUMP_SLACK
        jumped = (distance > most * self.control_dt).any(-1)
        length, starts = 0, []
        for row, follows in enumerate(self.follows & ~jumped):
            length = length + 1 if follows else 0
            if length == steps + 1:
                starts.append(row - steps)
                length = 0
        return np.array(starts, np.int64)


COLUMNS = ("state.position", "state.velocity", "command")


def record_play(
    scenario: str, driver: Driver, steps: int, seed: int, keywords: Keywords
) -> RecordedPlay:
    """Record ``steps`` control steps of a driver in one world.

    Args:
        scenario: Name of the scenario.
        driver: Driver of ``paddle_0`` and of the seats of its team.
        steps: Number of control steps.
        seed: Seed of the first episode.
        keywords: Keywords of the environment.
    """
    world = build_driven_world(driver, scenario, 1, keywords)
    episodes, left = [], steps
    for episode in play_episodes(world, steps, seed, COLUMNS):
        episodes.append({n: value[:left] for n, value in episode.columns.items()})
        left -= len(episode)
        if left <= 0:
            break
    world.close()
    return _joined(world.scene, world.control_dt, episodes)


def load_recordings(paths: Sequence[Path]) -> RecordedPlay:
    """Read recordings.

    Raises:
        ValueError: There are no recordings, or they are of several scenarios.
    """
    recordings = [read_recording(path) for path in paths]
    names = {recording.head["scenario"] for recording in recordings}
    if len(names) != 1:
        found = ", ".join(sorted(names)) or "none"
        raise ValueError(
            f"fit: recordings of one scenario are needed, found: {found}; "
            "airhockey data record makes them"
        )
    scenario = scenario_of(recordings[0])
    episodes = [e.columns for r in recordings for e in r.episodes if len(e)]
    return _joined(scenario.scene, recordings[0].head["control_dt"], episodes)


def _joined(scene: Scene, dt: float, episodes: Sequence[Columns]) -> RecordedPlay:
    """Return the episodes as one array of rows."""
    position, velocity, command = (
        np.concatenate([episode[name] for episode in episodes]) for name in COLUMNS
    )
    follows = [np.arange(len(episode["command"])) > 0 for episode in episodes]
    return RecordedPlay(scene, dt, position, velocity, command, np.concatenate(follows))
