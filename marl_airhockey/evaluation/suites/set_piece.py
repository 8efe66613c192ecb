"""Scenario whose episodes are the pieces of a suite."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.evaluation.suites.pieces import Pieces, load_pieces
from marl_airhockey.sim.contracts.scenario import Transition
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.placement import check_placement
from marl_airhockey.toolkit.versus import Versus
from marl_airhockey.types import Array, Memory

LINEUPS = {
    "duel": ((0, 0.0), (2, 0.0)),
    "doubles": ((0, 0.12), (0, -0.12), (2, -0.12), (2, 0.12)),
}
"""Lineups by game."""


@dataclass(frozen=True, kw_only=True)
class SetPiece(Versus):
    """Piece of a suite: a situation of a game in which ``paddle_0`` has a task.

    Observation, reaction time and rules are those of duel or doubles, but no puck is
    served.

    Start:
        Piece (seed of the world + number of the episode, from 0) modulo the number of
        pieces. `reset` with ``seed=k`` therefore begins piece k, and later episodes the
        pieces after it.

    Termination:
        The task is solved, a goal is scored, or the puck would be served.
    """

    suite: str
    """Name of a suite, or path of its file."""
    hide: bool = True
    """False to show pucks that a piece hides."""

    def __post_init__(self) -> None:
        task, given = self.pieces.task, self.seconds
        if given not in (Versus.seconds, task.seconds):
            raise ValueError(
                f"seconds: {given}; the pieces of {self.suite} last {task.seconds:g} s"
            )
        if self.pucks != 1:
            raise ValueError(f"pucks: {self.pucks}; pieces have 1")
        if task.rule not in RULES:
            raise ValueError(
                f"{self.suite}: {unknown_name('rule', task.rule, list(RULES))}"
            )
        object.__setattr__(self, "seconds", task.seconds)
        super().__post_init__()
        n = len(self.pieces)
        nobody = np.zeros((n, len(self.lineup)), np.bool_)
        check_placement(self._states(np.arange(n)), self.scene, nobody, self.seconds)

    @cached_property
    def pieces(self) -> Pieces:
        """All pieces."""
        return load_pieces(self.suite)

    @property
    def lineup(self) -> tuple[tuple[int, float], ...]:
        return LINEUPS[self.pieces.task.game]

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = self._states(self._rows(rng))
        return state, self.initial_memory(state, rng)

    def _states(self, rows: Array) -> State:
        """Return the states of some pieces, by index (W,)."""
        state = self.scene.still_state(len(rows))
        state.position[:] = self.pieces.position[rows]
        state.velocity[:] = self.pieces.velocity[rows]
        return state

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        hidden = self.pieces.hidden[self._rows(rng)]
        return {**super().initial_memory(state, rng), "unseen": hidden}

    def _rows(self, rng: RandomStreams) -> Array:
        """Return the index of the piece of each world (W,)."""
        return (rng.ordinals % np.uint64(len(self.pieces))).astype(np.int64)

    @property
    def moving_start(self) -> bool:
        return True

    @cached_property
    def hides(self) -> bool:
        return self.hide and bool(np.ptp(self.pieces.hidden, axis=1).any())

    def hidden(self, state: State, memory: Memory) -> Array:
        begin, end = (memory["unseen"][..., k] for k in (0, 1))
        now = state.time + 1e-6
        return np.asarray((now >= begin) & (now < end))[..., None]

    def needs_serve(self, t: Transition) -> Array | None:
        return None

    def _stopped(self, t: Transition) -> Array:
        """(...) bool: a goal was scored, or the puck would be served."""
        scored = (t.new_memory["goals"] != t.memory["goals"]).any(-1)
        stopped: Array = scored | (t.new_memory["serve"] != 0.0).any(-1)
        return stopped

    def _solved(self, t: Transition) -> Array:
        """(...) bool: the task is solved."""
        over = self._stopped(t) | t.time_limit_reached
        return RULES[self.pieces.task.rule](t, over)

    def terminated(self, t: Transition) -> Array:
        return self._stopped(t) | self._solved(t)

    def _over(self, t: Transition) -> Array:
        return self.terminated(t) | t.time_limit_reached

    def success(self, t: Transition) -> Array:
        """(..., seats) bool: a team solves the task, or the other one prevents it."""
        solved = self._solved(t)
        prevented = self._over(t) & ~solved
        return np.stack([solved, prevented], -1)[..., self.teams]

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        task: 1 at the end for the team that succeeds, -1 for the other team.
        """
        result = np.where(self.success(t), 1.0, -1.0)
        return {"task": np.where(self._over(t)[..., None], result, 0.0)}


Rule = Callable[[Transition, Array], Array]
"""Function of a transition and of the end of the piece, (...) bool, that returns True
(...) where the task is solved."""


def keep(t: Transition, over: Array) -> Array:
    """Return True (...) at the end if no goal was conceded."""
    clean: Array = over & (t.new_memory["goals"][..., 1] == 0.0)
    return clean


def score(t: Transition, over: Array) -> Array:
    """Return True (...) if a goal was scored."""
    scored: Array = t.new_memory["goals"][..., 0] > 0.0
    return scored


def hand_over(t: Transition, over: Array) -> Array:
    """Return True (...) if ``paddle_1`` touches the puck next after ``paddle_0``."""
    before, after = t.memory["toucher"], t.new_memory["toucher"]
    passed: Array = ((before == 1.0) & (after == 2.0)).any(-1)
    return passed


RULES: Mapping[str, Rule] = {"keep": keep, "score": score, "pass": hand_over}
"""Rules of success by name."""
