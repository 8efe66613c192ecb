"""The backend contract: paddle commands in, the next state out; B worlds at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from marl_airhockey.cast import Cast
from marl_airhockey.state import Array, State

TOLD_SPEED = 5.0
"""m/s: a told paddle that must be faster than this is lifted, without contact."""


@dataclass(frozen=True)
class Command:
    """What the paddles do in a step, table frame."""

    velocity: Array
    """(B, seats, 2) m/s to be reached at the end of the step by a linear ramp"""
    told: Array | None = None
    """(B, seats, 4) position and velocity at the end of the step, nan where a seat
    asks; None if all do"""


class Backend(ABC):
    """Physics of B worlds with one cast.

    Paddles track their command and are not pushed back by a puck.
    """

    exact: ClassVar[bool]
    """True if row i does not depend on the number of worlds, to the bit."""
    realtime: ClassVar[bool] = False
    """True if a step takes as long as it lasts."""
    default_substeps: ClassVar[int]

    def __init__(
        self, cast: Cast, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        self.cast, self.num_worlds = cast, num_worlds
        self.control_dt, self.substeps = control_dt, substeps

    @classmethod
    def available(cls) -> str | None:
        """None, or the reason why this backend cannot run here and the fix."""
        return None

    @classmethod
    def supports(cls, cast: Cast) -> str | None:
        """None, or the reason why this backend cannot play this cast."""
        return None

    @abstractmethod
    def set_physics(self, values: dict[str, Array], mask: Array) -> None:
        """Set the parameters of the worlds of a mask (B,); values are (B,) each."""

    @abstractmethod
    def start(self, state: State, mask: Array) -> None:
        """Go on from ``state`` (of all B worlds); those of a mask (B,) start anew."""

    @abstractmethod
    def step(self, command: Command) -> State:
        """Move all worlds by ``control_dt``; ``time`` counts from the last start."""

    def close(self) -> None:
        """Let go of whatever the backend holds."""
        return None
