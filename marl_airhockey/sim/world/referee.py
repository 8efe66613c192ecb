"""Referee: the rules of a scenario, applied to a step of all worlds in one loop."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario, Transition
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Fused, Sink, Source
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.sim.world.episode import EpisodeCounters
from marl_airhockey.types import Array, Memory


class Verdict(NamedTuple):
    """Verdict on a step, (B, ...) arrays."""

    memory: Memory
    terms: dict[str, Array]
    """Reward terms by name, (B, seats) each"""
    counters: dict[str, Array]
    """New counters of `EpisodeCounters`, by name"""
    outcome: dict[str, Array]
    """``reward`` (B, seats), ``terminated``, ``truncated``, ``serves`` (B,), if the
    game serves, and ``applied_action`` (B, seats, 2) float32: fractions of top speed in
    ego frames"""


class Step(NamedTuple):
    """Arrays that a verdict is made from."""

    before: State
    command: Array
    """(B, seats, 2) m/s, table frame"""
    after: State
    memory: Memory
    """Memory of before the step"""
    episode: EpisodeCounters
    """Counters of before the step"""
    limit: Array
    """(B,) control steps after which the clock ends an episode"""

    @property
    def sources(self) -> tuple[Source, ...]:
        """Sources of the compiled rules."""
        action = {"command": self.command, "limit": self.limit}
        episode = self.episode
        return (
            *(vars(self.before), vars(self.after), self.memory),
            *(vars(episode), episode.physics, action),
        )


class Referee:
    """Rules of a scenario, and the score of its episodes.

    Args:
        scenario: Scenario whose rules are applied.
        rotations: Rotations (S, 2, 2) from the table frame to each seat's ego frame.
        tracks_commands: Whether paddles move as commanded unless something stops them.
    """

    def __init__(
        self, scenario: Scenario, rotations: Array, tracks_commands: bool
    ) -> None:
        self.scenario, self._tracks_commands = scenario, tracks_commands
        self._rotations = rotations
        self._straight = bool((rotations == np.eye(2)).all())
        self._fused = Fused(self._judge, scenario.name)

    @property
    def refused(self) -> str | None:
        """Reason why the rules run as plain numpy; None if they are compiled."""
        return self._fused.refused

    def prepare(self, step: Step) -> Verdict:
        """Compile the rules for arrays like these; return the verdict, fresh arrays."""
        return Verdict(*self._fused.prepare(*step.sources))

    def stage(self, step: Step, verdict: Verdict) -> Stage:
        """Return the rules from a step into a verdict whose arrays stay."""
        return self._fused.stage(step.sources, verdict)

    def _judge(
        self,
        first: Source,
        last: Source,
        memory: Memory,
        episode: Source,
        physics: Source,
        action: Source,
    ) -> tuple[Sink, ...]:
        game, before, after = self.scenario, State(**first), State(**last)
        command, cycles = action["command"], episode["cycles"] + 1
        over = cycles >= action["limit"]
        t = Transition(before, command, after, memory, memory, over)
        t = t._replace(new_memory=game.next_memory(t))
        terms, terminated = game.all_reward_terms(t), game.is_terminated(t)
        success = game.is_success(t)
        _check_shapes(terms, terminated, success, episode["returns"].shape)
        if success.ndim == after.time.ndim:
            success = success[..., None]
        reward = reduce(np.add, terms.values(), 0.0 * episode["returns"])
        counters = {
            "cycles": cycles,
            "returns": episode["returns"] + reward,
            "success": episode["success"] | success,
        }
        if "touches" in memory:
            fresh = counters["success"].any(-1) & ~episode["success"].any(-1)
            few = t.new_memory["touches"].sum((-1, -2)) <= 1
            counters["first_shot"] = episode["first_shot"] | (fresh & few)
        # What a paddle could not do, as a puck or another paddle was in its way.
        rotated = after.paddle_velocity if self._tracks_commands else command
        if not self._straight:
            rotated = (self._rotations @ rotated[..., None])[..., 0]
        share = rotated / physics["paddle_speed"][..., None, None]
        outcome = {
            "reward": reward,
            "terminated": terminated,
            "truncated": over & ~terminated,
            "applied_action": share.astype(np.float32),
        }
        serves = game.needs_serve(t)
        if serves is not None:
            outcome["serves"] = serves & ~terminated & ~over
        return t.new_memory, terms, counters, outcome


def _check_shapes(
    terms: Memory, terminated: Array, success: Array, shape: tuple[int, ...]
) -> None:
    """Refuse results of a scenario that have not a number for each seat, (..., S)."""
    lead = shape[:-1]
    per_seat = "a number for each seat, {}; end one of the whole world with [..., None]"
    for name, term in terms.items():
        if np.shape(term) not in (shape, (*lead, 1)):
            raise ValueError(
                f"reward term {name!r} has shape {np.shape(term)}, expected "
                + per_seat.format(shape)
            )
    if np.shape(terminated) != lead:
        raise ValueError(
            f"terminated has shape {np.shape(terminated)}, expected {lead}: a truth "
            "value for each world"
        )
    if np.shape(success) not in (lead, shape, (*lead, 1)):
        raise ValueError(
            f"success has shape {np.shape(success)}, expected {lead}, or {shape} for "
            "each seat"
        )
