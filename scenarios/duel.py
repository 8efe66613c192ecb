"""One against one: get the puck into the other's goal."""

from __future__ import annotations

from dataclasses import dataclass

from marl_airhockey.toolkit.versus import Versus


@dataclass(frozen=True, kw_only=True)
class Duel(Versus):
    """Game of two seats at opposite ends; rules as in `versus.Versus`."""

    @property
    def lineup(self) -> tuple[tuple[int, float], ...]:
        return (0, 0.0), (2, 0.0)


make = Duel
