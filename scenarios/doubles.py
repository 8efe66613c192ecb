"""Two players against two, who share the goals and the reward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from marl_airhockey.toolkit import Metres
from marl_airhockey.toolkit.versus import Versus


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


make = Doubles
