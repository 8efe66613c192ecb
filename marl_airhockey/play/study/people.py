"""People who take part in a running study."""

from __future__ import annotations

from dataclasses import dataclass

from marl_airhockey.play.study.archive import Diary
from marl_airhockey.play.study.course import Course


@dataclass
class Person:
    """Person who has agreed to take part."""

    key: str
    """Key of the person's page."""
    diary: Diary
    last_seen: float
    """Time at which the person's page was last connected, s."""


@dataclass
class Participant(Person):
    """Person who follows the plan."""

    course: Course

    @property
    def at_end(self) -> bool:
        """True if the participant has completed the plan."""
        return self.course.stage == "end"
