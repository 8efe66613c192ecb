"""Two players against two, who share the goals and the reward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import Array, Metres, Transition, Weight, length
from marl_airhockey.toolkit.versus import Versus

ROOM = 0.35
"""Distance of teammates from which they do not crowd each other, m."""


@dataclass(frozen=True, kw_only=True)
class Doubles(Versus):
    """Game with two players in each team.

    Start:
        The paddles of a team are side by side in front of their goal. The puck is
        served from the centre to one of the teams, which is sampled.

    Termination:
        A team wins.
    """

    version: ClassVar[int] = 1
    title: ClassVar[str] = "Two on two"
    apart: Metres = 0.24
    """Distance between teammates at the start, m."""
    crowding_weight: Weight = 0.0
    """Cost per second of teammates at the same position."""

    def __post_init__(self) -> None:
        super().__post_init__()
        paddle = 2 * self.table_geometry.paddle_radius
        widest = self.table_geometry.size[1] - paddle
        if not paddle <= self.apart <= widest:
            raise ValueError(
                f"apart: {self.apart:g} m; expected {paddle:.3f} to {widest:.3f} m, so "
                "that the paddles fit"
            )

    @property
    def lineup(self) -> tuple[tuple[int, float], ...]:
        y = self.apart / 2
        # The first seat of each team is on its own left.
        return (0, y), (0, -y), (2, -y), (2, y)

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        goal and shot: as in duel.
        crowding: ``-crowding_weight`` per second for teammates at the same position,
        decreasing linearly to 0 at a distance of 0.35 m; only if the weight is not 0.
        """
        terms = super().reward_terms(t)
        if self.crowding_weight:
            paddle, dt = t.after.paddle, t.after.time - t.before.time
            apart = length(paddle[..., ::2, :] - paddle[..., 1::2, :])[..., self.teams]
            crowded = np.maximum(1.0 - apart / ROOM, 0.0)
            terms["crowding"] = -self.crowding_weight * dt[..., None] * crowded
        return terms


make = Doubles
