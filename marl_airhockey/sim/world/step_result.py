"""Result of a step, as a world returns it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.control_step import Moment
from marl_airhockey.sim.world.observer import Observation
from marl_airhockey.types import Array, Memory


@dataclass
class StepResult:
    """Result of a step of B worlds for its open seats; arrays (B, ...), yours."""

    observation: Observation
    reward: Array
    """(B, open)"""
    terminated: Array
    """(B,) the episode ended for a reason inside the game"""
    truncated: Array
    """(B,) the clock ended it"""
    terms: dict[str, Array]
    """Reward terms by name, (B, open) each"""
    applied_action: Array
    """(B, open, 2) command as a fraction of top speed, ego frame"""
    violation: Array
    """(B, seats, 5) excess of the action over the limits, see `limits.VIOLATIONS`"""
    cost: Array
    """(B, open) violations in units of their limits, summed"""
    success: Array
    """(B, open) bool, latched for the episode"""
    first_shot: Array
    """(B,) bool: succeeded before a second distinct touch"""
    interruption: str = ""
    """Reason for which a real table had to end the episode"""
    final_observation: Observation | None = None
    """Observations at the end of the episodes that ended, rows of all others stale;
    None if none ended or worlds do not restart by themselves"""

    @staticmethod
    def of(moment: Moment, open_seats: Array | None) -> StepResult:
        """Return the result but for the observation; freshly allocated.

        Args:
            moment: after the step.
            open_seats: (open,) indices of the open seats; None for all.
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
        """Make it the result of no step in some worlds, by index: all 0."""
        numbers = [v for v in vars(self).values() if isinstance(v, np.ndarray)]
        for array in (*numbers, *self.terms.values()):
            array[worlds] = 0

    def judge_shown(
        self, game: Scenario, state: State, memory: Memory, moment: Moment, limit: Array
    ) -> None:
        """Replace reward and end by those of what is observed, with goals="dict".

        The reward must be `goal_reward` of the goals in the observation, or relabelled
        transitions would contradict recorded ones. Success is that of the true state.

        Args:
            game: Scenario with goals="dict".
            state: State of all worlds as seats know it, sensed or estimated.
            memory: Memory of all worlds as seats know it.
            moment: Moment after the step; the returns of its episodes are corrected.
            limit: Control steps (B,) after which the clock ends an episode.
        """
        episode = moment.episode
        met = game.goal_met(state, memory)
        reward = 1.0 * met[:, None]
        episode.returns[:] += reward - moment.verdict.outcome["reward"]
        self.reward[:] = self.terms["goal"][:] = reward
        self.terminated[:] = met | moment.state.lifted.any(-1)
        self.truncated[:] = (episode.cycles >= limit) & ~self.terminated
