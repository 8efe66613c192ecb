"""Result of a step of B worlds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.control_step import Moment
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.types import Array, Memory


@dataclass
class StepResult:
    """Result of a step of B worlds for the open seats, in new arrays (B, ...)."""

    observation: Observation
    reward: Array
    """Rewards (B, open)."""
    terminated: Array
    """True if the episode ended by the rules (B,)."""
    truncated: Array
    """True if the episode ended by the time limit (B,)."""
    terms: dict[str, Array]
    """Reward terms by name (B, open)."""
    applied_action: Array
    """Velocity of the paddle, or command of an arm (B, open, 2), divided by the top
    speed, ego frame."""
    violation: Array
    """Excess of the action over the limits (B, seats, 5), see `limits.VIOLATIONS`."""
    cost: Array
    """Sum of the violations, each divided by its limit (B, open)."""
    success: Array
    """True if the episode has been a success (B, open)."""
    first_shot: Array
    """True if it has been a success before a second distinct touch (B,)."""
    interruption: str = ""
    """Reason why an episode on a real table could not continue; "" for none."""
    final_observation: Observation | None = None
    """Last observations of the episodes that ended. All other rows are invalid. None if
    no episode ended, or if worlds do not reset automatically."""

    @staticmethod
    def of(moment: Moment, open_seats: Array | None) -> StepResult:
        """Return the result without the observation, in new arrays.

        Args:
            moment: Moment after the step.
            open_seats: Indices of the open seats (open,); None for all.
        """
        outcome, terms = moment.verdict.outcome, moment.verdict.terms
        violation, success = moment.commanded.violation.copy(), moment.episode.success
        reward, applied = outcome["reward"], outcome["applied_action"]
        rows = (reward, applied, violation[..., -1], success, *terms.values())
        if open_seats is None:
            own = [row.copy() for row in rows]
        else:
            own = [row[:, open_seats] for row in rows]
        return StepResult(
            observation={},
            reward=own[0],
            terminated=outcome["terminated"].copy(),
            truncated=outcome["truncated"].copy(),
            terms=dict(zip(terms, own[4:], strict=True)),
            applied_action=own[1],
            violation=violation,
            cost=own[2],
            success=own[3],
            first_shot=moment.episode.first_shot.copy(),
        )

    def clear(self, worlds: Array | slice = slice(None)) -> None:
        """Set all values of some worlds, by index (W,), to 0."""
        numbers = [v for v in vars(self).values() if isinstance(v, np.ndarray)]
        for array in (*numbers, *self.terms.values()):
            array[worlds] = 0

    def judge_shown(
        self, game: Scenario, state: State, memory: Memory, moment: Moment, limit: Array
    ) -> None:
        """Compute reward and end from the observed goals, for goals="dict".

        The reward must be `goal_reward` of the observed goals. Otherwise relabelled
        transitions would contradict recorded ones. Success follows the true state.

        Args:
            game: Scenario with goals="dict".
            state: State of all worlds that seats know, sensed or estimated.
            memory: Memory of all worlds that seats know.
            moment: Moment after the step; the returns of its episodes are corrected.
            limit: Number of control steps after which an episode is truncated (B,).
        """
        episode = moment.episode
        met = game.goal_met(state, memory)
        reward = 1.0 * met[:, None]
        episode.returns[:] += reward - moment.verdict.outcome["reward"]
        self.reward[:] = self.terms["goal"][:] = reward
        self.terminated[:] = met | moment.state.lifted.any(-1)
        self.truncated[:] = (episode.cycles >= limit) & ~self.terminated
