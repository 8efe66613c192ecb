"""Tracker of a block by its sightings."""

from __future__ import annotations

import numpy as np

from marl_airhockey.hardware.vision import Sighting
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array

REST = 0.002
"""Distance from its last position within which a block is at rest, m. Sightings differ
by less."""


class BlockTracker:
    """Tracker of one block, which rests until a puck hits it."""

    def __init__(self) -> None:
        self._last: Sighting | None = None
        """Sighting with the block's position."""
        self._velocity = np.zeros(2)

    @property
    def position(self) -> Array | None:
        """Position (2,) of the block, m; None before an episode begins."""
        return None if self._last is None else self._last.place

    def begin(self, seen: Sighting) -> None:
        """Begin an episode with a block at rest."""
        self._last, self._velocity = seen, np.zeros(2)

    def fill(self, state: State, seen: list[Sighting]) -> None:
        """Fill a state of one world with position and velocity of its block.

        Args:
            state: State of one world.
            seen: Sightings since the last call, oldest first.
        """
        for sighting in seen:
            last = self._last
            if last is None or sighting.taken <= last.taken:
                continue
            way, since = sighting.place - last.place, sighting.taken - last.taken
            moves = float(np.linalg.norm(way)) > REST
            self._velocity = way / since if moves else np.zeros(2)
            place = sighting.place if moves else last.place
            self._last = sighting._replace(place=place)
        if self._last is not None:
            state.position[0, state.bodies.block] = self._last.place
            state.velocity[0, state.bodies.block] = self._velocity
