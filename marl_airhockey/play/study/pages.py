"""Contents of the messages that pages receive in a study, as JSON."""

from __future__ import annotations

from typing import Any

from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.study.course import Course
from marl_airhockey.play.study.plan import Plan


def texts(plan: Plan) -> dict[str, Any]:
    """Return the texts and questions of a plan."""
    return {
        "title": plan.title,
        "version": plan.version,
        "information": paragraphs(plan.information),
        "agree": plan.agree,
        "thanks": plan.thanks,
        "blocks": plan.blocks,
        "questions": [{**vars(q), "largest": q.largest} for q in plan.questions],
    }


def seat_rows(course: Course | None, seats: int) -> list[dict[str, Any]]:
    """Return a row for each seat; the opponent is described as the plan allows."""
    title = course.title if course else ""
    other = {"driver": title, "taken": True, "title": title}
    return [{"driver": PERSON, "taken": course is not None}] + [other] * (seats - 1)


def progress(course: Course, waits: bool) -> dict[str, Any]:
    """Return the position of a participant in the plan.

    Args:
        course: Course of the participant.
        waits: True if a person is missing in another seat.
    """
    ended = course.stage == "end"
    return {
        "block": course.block,
        "game": course.game,
        "games": course.games,
        "time_left": round(course.time_left),
        "waits": waits,
        # The debriefing names the opponents, so it is only sent at the end.
        "debriefing": paragraphs(course.plan.debriefing) if ended else [],
    }


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs of a text, which are separated by blank lines."""
    return text.strip().split("\n\n") if text.strip() else []
