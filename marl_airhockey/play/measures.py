"""Measurements of players from the steps of recordings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np

from marl_airhockey.sim.core.limits import VIOLATIONS
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

INCOMING = 0.1
"""Least speed toward the player's own end of an incoming puck, m/s."""


@dataclass
class Player:
    """Measurements of one player in some episodes."""

    name: str
    person: bool
    points: list[float] = field(default_factory=list)
    """Points of each completed game: 1 for a win, 0.5 for a draw, 0 for a loss."""
    interceptions: list[bool] = field(default_factory=list)
    """One value for each incoming puck: True if it was hit."""
    shot_speeds: list[float] = field(default_factory=list)
    """Speeds of pucks that left the paddle toward the other end, m/s."""
    shot_placements: list[float] = field(default_factory=list)
    """Offsets from the centre at which those pucks would reach the other end, with wall
    bounces, m."""
    steps: int = 0
    limited: int = 0
    """Number of steps whose action exceeded a limit of speed, acceleration or
    workspace."""
    delays: list[float] = field(default_factory=list)
    """Round trips of the page, ms."""

    @property
    def games(self) -> int:
        """Number of completed games."""
        return len(self.points)

    def __add__(self, other: Player) -> Player:
        """Return the combined measurements of both players."""
        names = [f.name for f in fields(self) if f.name not in ("name", "person")]
        both = {name: getattr(self, name) + getattr(other, name) for name in names}
        return Player(self.name, self.person, **both)


def measure(player: Player, i: int, scene: Scene, episode: Episode) -> None:
    """Add the measurements of an episode to a player.

    Args:
        player: Player, changed in place.
        i: Index of the player's seat.
        scene: Scene of the episode.
        episode: Recorded episode.
    """
    columns, bodies, table = episode.columns, scene.bodies, scene.table
    bound = [VIOLATIONS.index(name) for name in ("speed", "acceleration", "reach")]
    player.steps += len(episode)
    player.limited += int((columns["violation"][:, i, bound] > 0).any(-1).sum())
    if "round_trip" in columns:
        trips = columns["round_trip"][:, i]
        player.delays += trips[np.isfinite(trips)].tolist()
    if not bodies.pucks:
        return
    rotation = table.rotation(scene.seats[i].side)
    position = columns["state.position"][:, bodies.puck] @ rotation.T
    velocity = columns["state.velocity"][:, bodies.puck] @ rotation.T
    corners = np.asarray(table.vertices) @ rotation.T
    end, half = corners[:, 0].max(), corners[:, 1].max() - table.puck_radius
    for k in range(bodies.pucks):
        hits = columns["state.touched"][:, i, k] > 0
        player.interceptions += interceptions(position[:, k], velocity[:, k], hits)
        for n in np.flatnonzero(hits & (velocity[:, k, 0] > INCOMING)):
            x, y = position[n, k]
            vx, vy = velocity[n, k]
            player.shot_speeds.append(float(np.hypot(vx, vy)))
            offset = y + vy * (end - x) / vx
            folded = half - abs((offset + half) % (4 * half) - 2 * half)
            player.shot_placements.append(float(folded))


def interceptions(position: Array, velocity: Array, hits: Array) -> Iterator[bool]:
    """Yield, for each puck that enters the player's own half, True if it was hit.

    Args:
        position: Positions of the puck (T, 2), ego frame, m.
        velocity: Velocities of the puck (T, 2), ego frame, m/s.
        hits: Steps in which the player's paddle hit the puck (T,), bool.
    """
    incoming = False
    for n in range(len(position)):
        near = position[n, 0] < 0.0 and velocity[n, 0] < -INCOMING
        if not incoming and near and not hits[n]:
            incoming = True
        elif incoming and hits[n]:
            incoming = False
            yield True
        elif incoming and velocity[n, 0] > INCOMING:
            incoming = False  # It bounced off the wall, or was re-served.
            yield False
