"""Driver that repeats the stored solutions of a suite."""

from __future__ import annotations

import numpy as np

from marl_airhockey.evaluation.suites.pieces import STEPS_OF_ACTIONS, load_pieces
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.types import Array


class Solution(Driver):
    """Driver of ``paddle_0`` that repeats the stored solution of each piece.

    Args:
        suite: Name of the suite, or path of its file.
    """

    def __init__(self, suite: str) -> None:
        self._actions = load_pieces(suite).solution / STEPS_OF_ACTIONS

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the piece and the number of the next step of each world."""
        piece = (rng.ordinals % np.uint64(len(self._actions))).astype(np.int64)
        return {"piece": piece, "step": np.zeros(worlds, np.int64)}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the next action of each solution."""
        step = np.minimum(memory["step"], self._actions.shape[1] - 1)
        actions = self._actions[memory["piece"], step]
        return actions, {**memory, "step": memory["step"] + 1}
