"""Episode: counters of the running episodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.types import Array


class PhysicsRows(Mapping[str, Array]):
    """Physics parameters of some worlds, which are rows of the parameters of all."""

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
    """Counters of the running episodes, arrays (B, ...)."""

    number: Array
    """Number of episodes begun since the last seed (B,)."""
    cycles: Array
    """Number of control steps in the episode (B,)."""
    returns: Array
    """Sum of rewards in the episode (B, seats)."""
    success: Array
    """True if the episode has been a success (B, seats)."""
    first_shot: Array
    """True if it has been a success before a second distinct touch (B,)."""
    physics: dict[str, Array]
    """Physics parameters by name (B,)."""

    @staticmethod
    def empty(worlds: int, seats: int) -> EpisodeCounters:
        """Return counters before the first episode, all 0."""
        return EpisodeCounters(
            number=np.zeros(worlds, np.int64),
            cycles=np.zeros(worlds, np.int64),
            returns=np.zeros((worlds, seats)),
            success=np.zeros((worlds, seats), np.bool_),
            first_shot=np.zeros(worlds, np.bool_),
            physics={},
        )

    def counted(self, counters: dict[str, Array]) -> EpisodeCounters:
        """Return a copy with other arrays for some counters."""
        return replace(self, **counters)  # type: ignore[arg-type]

    def copied(self) -> EpisodeCounters:
        """Return a copy with new arrays, except for the physics."""
        names = [f.name for f in fields(self) if f.name != "physics"]
        return self.counted({name: getattr(self, name).copy() for name in names})

    def draw_physics(
        self, physics: Physics, stream: RandomStreams, worlds: Array
    ) -> Array:
        """Sample the physics of new episodes; return the worlds in which it changed.

        Args:
            physics: Parameters and their ranges.
            stream: Random streams of all worlds.
            worlds: Indices of the worlds that begin an episode (W,).
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
        """Counters that begin at 0 in every episode."""
        return self.cycles, self.returns, self.success, self.first_shot
