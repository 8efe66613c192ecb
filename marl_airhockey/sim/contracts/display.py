"""Display: what people see of a game in addition to its bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, final

import numpy as np

from marl_airhockey.sim.contracts.mark import Caption, Mark, Meaning
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory


class Display:
    """Base of scenarios with marks, caption and result of a game.

    All functions are pure and work for arrays with any leading axes (...).
    """

    if TYPE_CHECKING:
        reward_regions: tuple[tuple[float, ...], ...]
        drag_regions: tuple[tuple[float, ...], ...]

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        """Return the marks to draw. Their number must not depend on the arguments."""
        return []

    def scores(self, memory: Memory) -> dict[str, Array]:
        """Return counts by name: (..., teams), (..., seats), or (..., 1) in total."""
        touches = memory.get("touches")
        return {} if touches is None else {"touches": touches.sum((-1, -2))[..., None]}

    def caption(self, memory: Memory) -> Caption:
        """Return the score as a short text; by default the `scores`."""
        texts, numbers = list[str](), list[Array]()
        for name, counts in self.scores(memory).items():
            each = list(np.moveaxis(counts, -1, 0))
            texts.append(f"{name} " + " : ".join(["{:.0f}"] * len(each)))
            numbers += each
        return Caption(", ".join(texts), *numbers)

    def deciders(self, memory: Memory) -> dict[str, Array]:
        """Return the rules that can decide a game, the most important one first.

        The values are (...) bool: the rule decides between the teams.
        """
        return {}

    def eliminated(self, memory: Memory) -> Array | None:
        """(..., seats) bool: the seat is eliminated; None if no seat ever is.

        The paddle of an eliminated seat is behind its side, whose goal line becomes a
        wall.
        """
        return None

    @final
    def display_arrays(self, state: State, memory: Memory) -> dict[str, Array]:
        """Return all numbers of the display, as arrays (..., *) by name.

        ``marks`` are rows (..., n, 6): x and y of both ends, radius, and 1 if shown.
        ``caption`` are the numbers of the caption. ``deciders`` are 1 for the rules
        that decide. The scores and ``eliminated`` are as the functions return them.
        """
        zero = np.zeros_like(state.time)

        def row(*numbers: Array | float) -> Array:
            return np.stack([zero + 1.0 * number for number in numbers], -1)

        marks = []
        for m in self.all_marks(state, memory):
            ends = [end[..., k] for end in (m.start, m.end) for k in (0, 1)]
            marks.append(row(*ends, m.radius, m.shown))
        arrays = {f"scores.{name}": 1.0 * n for name, n in self.scores(memory).items()}
        if marks:
            arrays["marks"] = np.stack(marks, -2)
        if numbers := self.caption(memory).numbers:
            arrays["caption"] = row(*numbers)
        if deciders := self.deciders(memory):
            arrays["deciders"] = row(*deciders.values())
        if (eliminated := self.eliminated(memory)) is not None:
            arrays["eliminated"] = eliminated
        return arrays

    @final
    def decided_by(self, memory: Memory) -> str:
        """Return the rule that decides one world's game, for example "goals".

        It is "" if the game is not decided.
        """
        return next((rule for rule, yes in self.deciders(memory).items() if yes), "")

    @final
    def shown_marks(self, state: State, memory: Memory) -> list[Mark]:
        """Return the visible marks of one world, including the regions."""
        return [mark for mark in self.all_marks(state, memory) if mark.shown]

    @final
    def all_marks(self, state: State, memory: Memory) -> list[Mark]:
        """Return `marks` and the regions."""
        paid = self.reward_regions
        means: list[Meaning] = ["reward" if r[3] > 0.0 else "cost" for r in paid]
        means += ["drag"] * len(self.drag_regions)
        regions = zip((*paid, *self.drag_regions), means, strict=True)
        circles = [
            Mark.circle(np.zeros_like(state.time)[..., None] + r[:2], r[2], kind)
            for r, kind in regions
        ]
        return [*circles, *self.marks(state, memory)]
