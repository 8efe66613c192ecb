"""Tally of a match: what each player did, for the card with the result."""

from __future__ import annotations

from typing import Any

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory


class Tally:
    """Hits and fastest shots of the seats, and goals and shots of the teams.

    Args:
        seats: Number of seats.
    """

    def __init__(self, seats: int) -> None:
        self._hits, self._fastest = np.zeros(seats, np.int64), np.zeros(seats)
        self._touching: Array = np.zeros(seats, np.bool_)
        self._scores: dict[str, list[float]] = {}
        self._streak: list[int] = []
        self._longest: list[int] = []

    def note(self, scenario: Scenario, state: State, memory: Memory) -> None:
        """Add a step.

        Args:
            scenario: Scenario of the match.
            state: State after the step, without leading axes.
            memory: Memory of the scenario, without leading axes.
        """
        touched, speed = state.touched > 0, np.hypot(*state.puck_velocity.T)
        touching: Array = np.asarray(touched.any(-1))
        self._hits += touching & ~self._touching
        self._touching = touching
        hit = np.where(touched, speed, 0.0).max(-1, initial=0.0)
        self._fastest = np.maximum(self._fastest, hit)
        scores = {k: np.ravel(v).tolist() for k, v in scenario.scores(memory).items()}
        goals, before = scores.get("goals"), self._scores.get("goals")
        if goals is not None:
            before = before or [0.0] * len(goals)
            self._streak = self._streak or [0] * len(goals)
            gained = [int(new - old) for new, old in zip(goals, before, strict=True)]
            if any(gained):
                rows = zip(self._streak, gained, strict=True)
                self._streak = [n + more if more else 0 for n, more in rows]
            longest = self._longest or self._streak
            self._longest = list(map(max, longest, self._streak))
        self._scores = scores

    def state(self) -> dict[str, Any]:
        """Return the JSON of the tally.

        ``hits`` and ``fastest``, m/s, are by seat. ``scores``, ``stopped`` and
        ``streak`` are by team: goals, shots on goal that a paddle stopped, and the
        longest series of goals without one of another team. They are None in scenarios
        without goals.
        """
        goals, stopped = self._scores.get("goals"), self._scores.get("shots")
        whole = goals is not None
        return {
            "hits": self._hits.tolist(),
            "fastest": np.round(self._fastest, 2).tolist(),
            "scores": [int(x) for x in goals] if goals is not None else None,
            "stopped": [int(x) for x in stopped or goals or []] if whole else None,
            "streak": self._longest if whole else None,
        }
