"""Plays of set pieces whose actions can be stored and repeated."""

from __future__ import annotations

import numpy as np

from marl_airhockey.build import build_driven_world
from marl_airhockey.evaluation.suites.pieces import STEPS_OF_ACTIONS
from marl_airhockey.evaluation.suites.suite import Suite
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array


class Rounded(Driver):
    """Driver whose actions have the precision of stored ones."""

    def __init__(self, inner: Driver) -> None:
        self._inner, self.observe = inner, inner.observe
        self.trained_in = inner.trained_in

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the memory of the inner driver."""
        return self._inner.reset(seat, rng, worlds)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the rounded actions of the inner driver."""
        actions, memory = self._inner.act(view, memory)
        steps = np.rint(np.clip(actions, -1.0, 1.0) * STEPS_OF_ACTIONS)
        return steps / STEPS_OF_ACTIONS, memory


def play_actions(suite: Suite, player: Driver, number: int) -> tuple[Array, Array]:
    """Return the solved pieces (N,) and the actions (N, T, 2) of a play, rounded."""
    n, longest = len(suite), suite.pieces.solution.shape[1]
    keywords = Keywords(drivers=suite.drivers)
    world = build_driven_world(Rounded(player), suite.scenario, n, keywords)
    solved, actions = np.zeros(n, np.bool_), np.zeros((n, longest, 2))
    for k, each in enumerate(
        play_episodes(world, n, number * n, ("success", "action"))
    ):
        solved[k] = each.columns["success"][-1, 0] > 0
        actions[k, : len(each)] = each.columns["action"][:, 0]
    world.close()
    return solved, np.rint(actions * STEPS_OF_ACTIONS)
