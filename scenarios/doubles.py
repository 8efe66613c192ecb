"""Two against two: mates share a half and the reward."""

from __future__ import annotations

from dataclasses import dataclass

from marl_airhockey.toolkit.versus import Versus


@dataclass(frozen=True, kw_only=True)
class Doubles(Versus):
    """Two seats at either end, side by side; see `versus.Versus` for the rules."""

    apart: float = 0.24
    """m between mates at the start."""

    @property
    def lineup(self) -> tuple[tuple[int, float], ...]:
        y = self.apart / 2
        # Each team has its first seat on its own left.
        return (0, y), (0, -y), (2, -y), (2, y)


make = Doubles
