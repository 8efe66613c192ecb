"""Episode: the counters of running episodes, and the result of a step."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from marl_airhockey.types import Array
from marl_airhockey.world.observer import Observation


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
    final_observation: Observation | None = None
    """Observations at the end of the episodes that ended, rows of all others stale;
    None if none ended or worlds do not restart by themselves"""


@dataclass(frozen=True)
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
    physics: dict[str, Array]
    """Physical parameters, (B,) each"""

    def counted(self, counters: dict[str, Array]) -> Episode:
        """Return the same with other arrays for some counters."""
        return replace(self, **counters)  # type: ignore[arg-type]

    def copied(self) -> Episode:
        """Return the same with arrays of its own, but for the physics."""
        names = [f.name for f in fields(self) if f.name != "physics"]
        return self.counted({name: getattr(self, name).copy() for name in names})

    def begin(self, worlds: Array, cycles: Array | int = 0) -> None:
        """Set the counters of some worlds, by index, to those of a new episode."""
        self.cycles[worlds], self.returns[worlds] = cycles, 0.0
        self.success[worlds], self.first_shot[worlds] = False, False
