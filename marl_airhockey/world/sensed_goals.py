"""Goals judged by what is shown: with goals="dict" in profiles that sense.

There the reward must be `goal_reward` of the goals in the observation, or relabelled
transitions would contradict real ones. Success stays judged by the truth.
"""

from __future__ import annotations

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.state import State
from marl_airhockey.types import Array
from marl_airhockey.world.control_step import Moment
from marl_airhockey.world.step_result import StepResult


def judge_sensed(
    game: Scenario, sensed: State, moment: Moment, limit: Array, result: StepResult
) -> None:
    """Replace reward and end of a step by those of the sensed state, in place.

    Args:
        game: with goals="dict".
        sensed: of all worlds.
        moment: after the step; the returns of its episodes are corrected.
        limit: (B,) control steps after which the clock ends an episode.
        result: of the step.
    """
    episode = moment.episode
    met = game.goal_met(sensed, moment.verdict.memory)
    reward = 1.0 * met[:, None]
    episode.returns[:] += reward - moment.verdict.outcome["reward"]
    result.reward[:] = result.terms["goal"][:] = reward
    result.terminated[:] = met | moment.state.lifted.any(-1)
    result.truncated[:] = (episode.cycles >= limit) & ~result.terminated
