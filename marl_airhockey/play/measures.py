"""Measurements of a player, from the steps of recordings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np

from marl_airhockey.sim.core.limits import VIOLATIONS
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

INCOMING = 0.1
"""Speed toward one's own end from which a puck counts as incoming, m/s."""


@dataclass
class Player:
    """Measurements of one player, of some episodes."""

    name: str
    person: bool
    points: list[float] = field(default_factory=list)
    """Of each game that was played to the end: 1 if won, 0.5 if drawn, 0 if lost."""
    interceptions: list[bool] = field(default_factory=list)
    """One value for each incoming puck: True if it was hit."""
    shot_speeds: list[float] = field(default_factory=list)
    """Speeds of pucks that left the paddle toward the other end, m/s."""
    shot_placements: list[float] = field(default_factory=list)
    """Offsets from the middle at which those pucks would reach the other end, banks
    included, m."""
    steps: int = 0
    limited: int = 0
    """Steps whose action exceeded the limits of speed, acceleration or reach."""
    delays: list[float] = field(default_factory=list)
    """Round trips of the page, ms."""

    @property
    def games(self) -> int:
        """Number of games that were played to the end."""
        return len(self.points)

    def __add__(self, other: Player) -> Player:
        """Return both players' measurements as those of one."""
        names = [f.name for f in fields(self) if f.name not in ("name", "person")]
        both = {name: getattr(self, name) + getattr(other, name) for name in names}
        return Player(self.name, self.person, **both)


def measure(player: Player, i: int, scene: Scene, episode: Episode) -> None:
    """Add the measurements of an episode to a player.

    Args:
        player: is changed.
        i: index of the player's seat.
        scene: in which it was.
        episode: as it was recorded.
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
    """Yield, each time that a puck came into one's own half, whether it was hit.

    Args:
        position: of the puck, (T, 2) m, ego frame.
        velocity: of the puck, (T, 2) m/s, ego frame.
        hits: (T,) steps in which one's paddle hit it.
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
            incoming = False  # It came back from the wall, or was served anew.
            yield False
