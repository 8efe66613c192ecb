"""Judges a step of B worlds and shows what came of it, in one loop over the worlds."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import NamedTuple

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.state import State
from marl_airhockey.jit.fused import Fused, Sink, Source
from marl_airhockey.jit.pipeline import Stage
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.episode import Episode


class Verdict(NamedTuple):
    """What a step means, (B, ...) arrays that nobody else holds."""

    memory: Memory
    terms: dict[str, Array]
    """Reward terms by name, (B, seats) each"""
    counters: dict[str, Array]
    """The new arrays of `Episode`, by name"""
    outcome: dict[str, Array]
    """``reward`` (B, seats), ``terminated``, ``truncated`` (B,), and ``sent``
    (B, seats, 2) as fractions of top speed in ego frames, float32"""
    shown: dict[str, Array]
    """What every seat sees of the state as it is; see `observer.Observer.show`"""


Show = Callable[[State, Memory], Sink]
"""What is shown of a state and a memory, to every seat."""


class Referee:
    """Applies the rules of a scenario to a step and keeps the score of its episode.

    Args:
        scenario: whose rules.
        rotations: (S, 2, 2) from the table frame to each seat's ego frame.
        show: shows the new state, in the same loop.
    """

    def __init__(self, scenario: Scenario, rotations: Array, show: Show) -> None:
        self._scenario, self._show = scenario, show
        self._rotations = rotations
        self._straight = bool((rotations == np.eye(2)).all())
        self._fused = Fused(self._judge, f"the judging of {scenario.name!r}")

    @property
    def refused(self) -> str | None:
        """Why the rules run as plain numpy, if they do."""
        return self._fused.refused

    def judge(
        self,
        before: State,
        sent: Array,
        after: State,
        memory: Memory,
        episode: Episode,
        limit: Array,
    ) -> Verdict:
        """The verdict on a step.

        Args:
            before: the step.
            command: (B, seats, 2) m/s, table frame.
            after: the step.
            memory: before the step.
            episode: its counters before the step.
            limit: (B,) control steps after which the clock ends an episode.
        """
        return Verdict(
            *self._fused(*_sources(before, sent, after, memory, episode, limit))
        )

    def stage(
        self,
        before: State,
        sent: Array,
        after: State,
        memory: Memory,
        episode: Episode,
        limit: Array,
        verdict: Verdict,
    ) -> Stage:
        """The same from and into arrays that stay, the last being those of a verdict.

        Raises:
            Unchained: the rules are not compiled for such arrays.
        """
        sources = _sources(before, sent, after, memory, episode, limit)
        return self._fused.stage(sources, verdict)

    def _judge(
        self,
        first: Source,
        last: Source,
        memory: Memory,
        episode: Source,
        physics: Source,
        action: Source,
    ) -> tuple[Sink, ...]:
        game, before, after = self._scenario, State(**first), State(**last)
        sent = action["sent"]
        new = game.next_memory(memory, before, sent, after)
        terms = game.all_reward_terms(before, sent, after, memory, new)
        terminated = game.is_terminated(after, new)
        success = game.is_success(after, new)
        if success.ndim == after.time.ndim:
            success = success[..., None]
        cycles = episode["cycles"] + 1
        reward = reduce(np.add, terms.values(), 0.0 * episode["returns"])
        counters = {
            "cycles": cycles,
            "returns": episode["returns"] + reward,
            "success": episode["success"] | success,
        }
        if "touches" in memory:
            fresh = counters["success"].any(-1) & ~episode["success"].any(-1)
            few = new["touches"].sum((-1, -2)) <= 1
            counters["first_shot"] = episode["first_shot"] | (fresh & few)
        turned = sent
        if not self._straight:
            turned = (self._rotations @ sent[..., None])[..., 0]
        share = turned / physics["paddle_speed"][..., None, None]
        outcome = {
            "reward": reward,
            "terminated": terminated,
            "truncated": (cycles >= action["limit"]) & ~terminated,
            "sent": share.astype(np.float32),
        }
        return new, terms, counters, outcome, self._show(after, new)


def _sources(
    before: State,
    sent: Array,
    after: State,
    memory: Memory,
    episode: Episode,
    limit: Array,
) -> tuple[Source, ...]:
    action = {"sent": sent, "limit": limit}
    return (
        vars(before),
        vars(after),
        memory,
        vars(episode),
        episode.physics,
        action,
    )
