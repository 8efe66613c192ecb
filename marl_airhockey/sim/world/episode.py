"""Episode: the counters of running episodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.types import Array


class PhysicsRows(Mapping[str, Array]):
    """Parameters of some worlds: those of all by name, of which rows are taken."""

    def __init__(self, physics: Mapping[str, Array], worlds: Array) -> None:
        self._physics, self._worlds = physics, worlds

    def __getitem__(self, name: str) -> Array:
        return np.asarray(self._physics[name][self._worlds])

    def __iter__(self) -> Iterator[str]:
        return iter(self._physics)

    def __len__(self) -> int:
        return len(self._physics)


@dataclass(frozen=True)
class EpisodeCounters:
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

    @staticmethod
    def empty(worlds: int, seats: int) -> EpisodeCounters:
        """Return counters at zero, of no episode yet."""
        return EpisodeCounters(
            number=np.zeros(worlds, np.int64),
            cycles=np.zeros(worlds, np.int64),
            returns=np.zeros((worlds, seats)),
            success=np.zeros((worlds, seats), np.bool_),
            first_shot=np.zeros(worlds, np.bool_),
            physics={},
        )

    def counted(self, counters: dict[str, Array]) -> EpisodeCounters:
        """Return the same with other arrays for some counters."""
        return replace(self, **counters)  # type: ignore[arg-type]

    def copied(self) -> EpisodeCounters:
        """Return the same with arrays of its own, but for the physics."""
        names = [f.name for f in fields(self) if f.name != "physics"]
        return self.counted({name: getattr(self, name).copy() for name in names})

    def draw_physics(
        self, physics: Physics, stream: RandomStreams, worlds: Array
    ) -> Array:
        """Draw the physics of new episodes; return the worlds in which it is new.

        Args:
            physics: parameters and their ranges.
            stream: of all worlds.
            worlds: (W,) indices of those that begin an episode.
        """
        if not self.physics:
            self.physics.update(physics.draw(stream))
            return np.arange(len(self.number))
        if not physics.varies:
            return worlds[:0]
        for name, value in physics.draw(stream.select(worlds)).items():
            self.physics[name][worlds] = value
        return worlds

    @property
    def running(self) -> tuple[Array, ...]:
        """Counters that begin at 0 with every episode."""
        return self.cycles, self.returns, self.success, self.first_shot
