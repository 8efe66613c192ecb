"""Referee: the rules of a scenario, applied to a step of all worlds in one loop."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario, Transition
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Fused, Sink, Source
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.sim.world.episode import EpisodeCounters
from marl_airhockey.types import Array, Memory


class Verdict(NamedTuple):
    """Verdict on a step, arrays (B, ...)."""

    memory: Memory
    terms: dict[str, Array]
    """Reward terms by name (B, seats)."""
    counters: dict[str, Array]
    """New counters of `EpisodeCounters`, by name."""
    outcome: dict[str, Array]
    """Outcome by name: ``reward`` (B, seats); ``terminated`` and ``truncated`` (B,);
    ``serves`` (B,), if the game serves pucks; ``applied_action`` (B, seats, 2) float32,
    the velocity of the paddle, or the command of an arm, divided by the top speed, ego
    frames."""


class Step(NamedTuple):
    """Arrays from which a verdict is computed."""

    before: State
    command: Array
    """Commanded velocities (B, seats, 2), table frame, m/s."""
    after: State
    memory: Memory
    """Memory before the step."""
    episode: EpisodeCounters
    """Counters before the step."""
    limit: Array
    """Number of control steps after which an episode is truncated (B,)."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """Inputs of the compiled rules."""
        action = {"command": self.command, "limit": self.limit}
        episode = self.episode
        return (
            *(vars(self.before), vars(self.after), self.memory),
            *(vars(episode), episode.physics, action),
        )


class Referee:
    """Rules of a scenario and counters of its episodes.

    Args:
        scenario: Scenario with the rules.
        rotations: Rotations from the table frame to each seat's ego frame (S, 2, 2).
        tracks_commands: True if paddles move as commanded until a contact stops them.
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
        """Compile the rules for arrays like these; return the verdict in new arrays."""
        return Verdict(*self._fused.prepare(*step.sources))

    def stage(self, step: Step, verdict: Verdict) -> Stage:
        """Return the stage that applies the rules to a step and fills a verdict."""
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
        # Contacts can stop a paddle that tracks commands, so use its actual velocity.
        rotated = after.paddle_velocity if self._tracks_commands else command
        if not self._straight:
            rotated = products(rotated, self._rotations)
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
    """Check that the results of a scenario have a number for each seat (..., S)."""
    lead = shape[:-1]
    per_seat = "a number for each seat, {}; add [..., None] to a number for the world"
    for name, term in terms.items():
        if np.shape(term) not in (shape, (*lead, 1)):
            raise ValueError(
                f"reward term {name!r} has shape {np.shape(term)}, expected "
                + per_seat.format(shape)
            )
    if np.shape(terminated) != lead:
        raise ValueError(
            f"terminated has shape {np.shape(terminated)}, expected {lead}: a bool for "
            "each world"
        )
    if np.shape(success) not in (lead, shape, (*lead, 1)):
        raise ValueError(
            f"success has shape {np.shape(success)}, expected {lead}, or {shape} for "
            "each seat"
        )
