"""Opponents of a plan, at the table."""

from __future__ import annotations

from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.study.plan import Opponent, Plan
from marl_airhockey.policies.trust import Trust


def open_match(plan: Plan) -> LiveMatch:
    """Return the match of a plan, in which each opponent has been seated once.

    Raises:
        ValueError: a plan that cannot be played; names the opponent.
    """
    match = LiveMatch(
        plan.scenario,
        {},
        {"backend": plan.backend, "profile": plan.profile, "options": plan.options},
    )
    # A plan may come from elsewhere, and nobody looks at what it loads.
    Trust.answer = False
    seats = len(match.seats)
    if (seats == 1) != (not plan.opponents):
        needs = "no opponents" if seats == 1 else "opponents"
        raise ValueError(f"opponents: {plan.scenario} needs {needs}")
    if seats != 2 and PERSON in [opponent.name for opponent in plan.opponents]:
        raise ValueError("opponents: a person can be one in a game of two seats alone")
    for opponent in (plan.practice_opponent, *plan.opponents):
        seat_opponent(match, opponent)
    return match


def seat_opponent(match: LiveMatch, opponent: Opponent) -> None:
    """Give all seats but the participant's to an opponent."""
    match.set_handicap(opponent.handicap)
    for i in range(1, len(match.seats)):
        match.set_driver(i, opponent.name)
