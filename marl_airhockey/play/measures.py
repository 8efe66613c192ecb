"""Measures: see the definitions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from marl_airhockey.core.limits import VIOLATIONS
from marl_airhockey.types import Array

MOVES = 0.1
"""m/s: a faster paddle moves."""


COMES = 0.1
"""m/s: a puck that nears one's own end faster comes."""


LONGEST = 1.5
"""s after a serve within which a movement counts as the reaction to it."""


@dataclass
class Player:
    """All that was seen of somebody, over all episodes."""

    name: str
    person: bool
    won: int = 0
    drawn: int = 0
    lost: int = 0
    comes: list[bool] = field(default_factory=list)
    """Of every puck that came: whether it was met."""
    reactions: list[float] = field(default_factory=list)
    """s from a serve to the first movement"""
    shots: list[float] = field(default_factory=list)
    """m/s of pucks that left the paddle toward the other end"""
    places: list[float] = field(default_factory=list)
    """m aside of the middle at which they would reach the other end, banks included"""
    steps: int = 0
    limited: int = 0
    """Steps in which what was asked exceeded speed, acceleration or reach"""
    delays: list[float] = field(default_factory=list)
    """ms, round trips of the page"""

    @property
    def games(self) -> int:
        """That were played to the end."""
        return self.won + self.drawn + self.lost


def _watch(
    player: Player,
    i: int,
    seat: dict[str, Any],
    meta: dict[str, Any],
    steps: list[dict[str, Any]],
) -> None:
    """Measure a player at a seat in an episode."""
    bound = [VIOLATIONS.index(name) for name in ("speed", "acceleration", "reach")]
    for row in steps:
        player.steps += 1
        player.limited += any(row["excess"][i][k] > 0 for k in bound)
        if row["delays"][i] is not None:
            player.delays.append(row["delays"][i])
    if not steps or not steps[0]["pucks"]:
        return
    turn = np.array(seat["turn"])
    pucks = np.array([row["pucks"] for row in steps])
    place, motion = pucks[..., :2] @ turn.T, pucks[..., 2:] @ turn.T
    speed = np.hypot(*np.array([row["pad_velocities"][i] for row in steps]).T)
    corners = np.array(meta["court"]["table"]) @ turn.T
    far, half = corners[:, 0].max(), corners[:, 1].max() - meta["court"]["puck"]
    for k in range(pucks.shape[1]):
        hits = np.array([["hit", i, k] in row["events"] for row in steps])
        player.comes += _comes(place[:, k], motion[:, k], hits)
        for n in np.flatnonzero(hits & (motion[:, k, 0] > COMES)):
            x, y = place[n, k]
            vx, vy = motion[n, k]
            player.shots.append(float(np.hypot(vx, vy)))
            aside = y + vy * (far - x) / vx
            folded = half - abs((aside + half) % (4 * half) - 2 * half)
            player.places.append(float(folded))
        dt = meta["control_dt"]
        player.reactions += _reactions(place[:, k], motion[:, k], speed, dt)


def _comes(place: Array, motion: Array, hits: Array) -> Iterator[bool]:
    """Of every time that a puck came into one's own half: whether it was met."""
    coming = False
    for n in range(len(place)):
        near = place[n, 0] < 0.0 and motion[n, 0] < -COMES
        if not coming and near and not hits[n]:
            coming = True
        elif coming and hits[n]:
            coming = False
            yield True
        elif coming and motion[n, 0] > COMES:
            coming = False  # it came back from the wall by itself, or was served anew
            yield False


def _reactions(place: Array, motion: Array, speed: Array, dt: float) -> Iterator[float]:
    """From each serve toward a player who stands still to the first movement, s."""
    jump = np.hypot(*np.diff(place, axis=0, prepend=place[:1] + 1.0).T) > 0.1
    served = jump & (np.hypot(*place.T) < 0.15) & (motion[:, 0] < -COMES)
    for n in np.flatnonzero(served):
        after = speed[n : n + round(LONGEST / dt)]
        if after[0] < MOVES and (after >= MOVES).any():
            yield float(np.argmax(after >= MOVES) * dt)
