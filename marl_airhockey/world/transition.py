"""Limits, physics and judging of a step as compiled calls on arrays that stay."""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.backend import Backend
from marl_airhockey.core.limits import INFINITE, Sent, limits_stage
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.core.state import RESULTS, State
from marl_airhockey.jit.pipeline import Pipeline, Stage
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.episode import Episode
from marl_airhockey.world.referee import Referee, Verdict


class Turn:
    """What `World.step` does where every seat asks, on arrays that stay.

    There are two sets of them, old and new, which change their parts at every step: a
    state, a memory and counters are overwritten by the step after the next.

    Args:
        backend: one that has a `Backend.stage`.
        referee: has judged such a step before, so that its rules are compiled.
        reach: of the seats.
        limit: (B,) see `Referee.judge`.
        state: as it may be before a step, like the next two.
        memory: of the scenario.
        episode: its physics are read at every step.

    Raises:
        Unchained: physics or rules are not one compiled function.
    """

    def __init__(
        self,
        backend: Backend,
        referee: Referee,
        reach: ReachPlanes,
        limit: Array,
        state: State,
        memory: Memory,
        episode: Episode,
    ) -> None:
        self._backend, dt = backend, backend.control_dt
        self._actions = np.zeros((len(limit), len(reach.share), 2))
        self._states = backend.empty_state(), backend.empty_state()
        self._sent = (Sent.blank(self._actions), Sent.blank(self._actions))
        self._verdicts = tuple(
            referee.judge(state, self._actions, state, memory, episode, limit)
            for _ in range(2)
        )
        values = episode.physics
        moves: list[list[Stage]] = []
        judgings: list[list[Stage]] = []
        for old, new in ((0, 1), (1, 0)):
            before, after, sent = self._states[old], self._states[new], self._sent[new]
            filtered = limits_stage(
                self._actions,
                before.position,
                before.velocity,
                self._sent[old].pushed,
                reach,
                values["paddle_speed"],
                values["paddle_acceleration"],
                dt,
                sent,
            )
            moved = backend.stage(sent.velocity, before, after)
            known = self._verdicts[old]
            judged = referee.stage(
                before,
                sent.velocity,
                after,
                known.memory,
                episode.counted(known.counters),
                limit,
                self._verdicts[new],
            )
            moves.append([filtered, moved])
            judgings.append([judged])
        self._move = Pipeline(len(limit), *moves)
        self._judge = Pipeline(len(limit), *judgings)
        self._old = 0

    def __call__(
        self,
        action: Array,
        state: State,
        memory: Memory,
        episode: Episode,
        pushed: Array,
    ) -> tuple[State, Sent, Verdict]:
        """The step; of the verdict, what is for the user is the user's own.

        Raises:
            ValueError: an asked velocity that is not finite.
        """
        old, new = self._old, 1 - self._old
        kept, counters = self._verdicts[old].memory, self._verdicts[old].counters
        if (
            state.position is not self._states[old].position
            or memory is not kept
            or episode.cycles is not counters["cycles"]
        ):
            self._load(state, memory, episode, pushed)
        self._actions[...] = action
        self._backend.begin()
        if not self._move(old):
            raise ValueError(INFINITE)
        self._backend.finish(self._sent[new].velocity, self._states[new])
        self._judge(old)
        self._old = new
        verdict = self._verdicts[new]
        terms, outcome, shown = (
            {name: array.copy() for name, array in part.items()}
            for part in (verdict.terms, verdict.outcome, verdict.shown)
        )
        own = Verdict(verdict.memory, terms, verdict.counters, outcome, shown)
        sent = self._sent[new]
        return self._states[new], sent._replace(excess=sent.excess.copy()), own

    def _load(
        self, state: State, memory: Memory, episode: Episode, pushed: Array
    ) -> None:
        """Go on from arrays of somebody else's."""
        verdict, mine = self._verdicts[self._old], self._states[self._old]
        for name in RESULTS:
            getattr(mine, name)[...] = getattr(state, name)
        for name, array in verdict.memory.items():
            array[...] = memory[name]
        for name, array in verdict.counters.items():
            array[...] = getattr(episode, name)
        self._sent[self._old].pushed[...] = pushed
