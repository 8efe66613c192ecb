"""What a step gives, and the counters of the running episodes."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

from marl_airhockey.types import Array
from marl_airhockey.world.observer import Observation


@dataclass
class StepResult:
    """What a step of B worlds gives, for its open seats; arrays (B, ...)."""

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
    """(B, open, 2) what acted: velocity as a fraction of top speed, ego frame"""
    violation: Array
    """(B, seats, 5) by how much what was asked exceeded the limits, see
    `limits.EXCESS`"""
    cost: Array
    """(B, open) the excesses in units of their limits, summed"""
    success: Array
    """(B, open) bool, latched for the episode"""
    first_shot: Array
    """(B,) bool: succeeded before a second distinct touch"""
    final_observation: Observation | None = None
    """Observations at the end of the episodes that ended, rows of all others stale;
    None if none ended or worlds do not restart by themselves"""


@dataclass
class Episode:
    """Counters of the running episodes, (B, ...) each."""

    number: Array
    """Episodes begun since the last seed"""
    cycles: Array
    """Control steps taken"""
    returns: Array
    """(B, seats) sum of rewards"""
    success: Array
    """(B, seats) latched"""
    first_shot: Array
    """(B,) latched"""
    physics: dict[str, Array] = field(default_factory=dict)
    """Physical parameters, (B,) each"""

    def counted(self, counters: dict[str, Array]) -> Episode:
        """The same with other counters."""
        new = copy(self)
        vars(new).update(counters)
        return new

    def copied(self) -> Episode:
        """The same with arrays of its own, but for the physics."""
        return self.counted(
            {k: v.copy() for k, v in vars(self).items() if k != "physics"}
        )
