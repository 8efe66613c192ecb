"""One player against one: shoot the puck into the opponent's goal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from marl_airhockey.toolkit.versus import Versus


@dataclass(frozen=True, kw_only=True)
class Duel(Versus):
    """Game with one player in each team.

    Start:
        Each paddle is in front of its goal. The puck is served from the centre to one
        of the players, who is sampled.

    Termination:
        A player wins.
    """

    version: ClassVar[int] = 1
    title: ClassVar[str] = "One on one"

    @property
    def lineup(self) -> tuple[tuple[int, float], ...]:
        return (0, 0.0), (2, 0.0)


make = Duel
