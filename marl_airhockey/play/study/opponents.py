"""Opponents of a plan as drivers of a match."""

from __future__ import annotations

from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.study.plan import Opponent, Plan
from marl_airhockey.policies.trust import Trust


def open_match(plan: Plan) -> LiveMatch:
    """Return the match of a plan, after checking that every opponent can play.

    Raises:
        ValueError: The plan cannot be played.
    """
    match = LiveMatch(
        plan.scenario,
        {},
        {"backend": plan.backend, "profile": plan.profile, "options": plan.options},
    )
    # A plan can come from an untrusted source, so it must not load pickled code.
    Trust.answer = False
    seats = len(match.seats)
    if (seats == 1) != (not plan.opponents):
        needs = "no opponents" if seats == 1 else "opponents"
        raise ValueError(f"opponents: {plan.scenario} needs {needs}")
    if seats != 2 and PERSON in [opponent.name for opponent in plan.opponents]:
        raise ValueError("opponents: a person can only be one in a game with two seats")
    for opponent in (plan.practice_opponent, *plan.opponents):
        seat_opponent(match, opponent)
    return match


def seat_opponent(match: LiveMatch, opponent: Opponent) -> None:
    """Set an opponent as the driver of all seats except the participant's."""
    for i in range(1, len(match.seats)):
        match.set_driver(i, opponent.name, opponent.handicap)
