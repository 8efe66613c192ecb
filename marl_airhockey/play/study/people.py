"""People who take part in a study that runs."""

from __future__ import annotations

from dataclasses import dataclass

from marl_airhockey.play.study.archive import Diary
from marl_airhockey.play.study.course import Course


@dataclass
class Person:
    """Somebody who has agreed to take part."""

    key: str
    """Key of their page."""
    diary: Diary
    last_seen: float
    """Time at which their page was last connected, s."""


@dataclass
class Participant(Person):
    """Person who goes through the plan."""

    course: Course

    @property
    def at_end(self) -> bool:
        """True if the plan is done."""
        return self.course.stage == "end"
