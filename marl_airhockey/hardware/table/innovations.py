"""Innovations: distances of a puck's sightings from the predictions of its filter."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.parameters import PUCK_SPEED_CAP
from marl_airhockey.types import Array

SKIPPED = 8
"""Number of ignored first sightings, as the velocity is not known yet."""
WEIGHT = 0.1
"""Weight of the newest innovation in their mean."""
LARGEST, MULTIPLE = 0.03, 20.0
"""Largest value that an innovation counts with, m, and as a multiple of the usual
one."""
USUAL = 0.001
"""First value of the usual innovation, m."""
LEARNING = 0.02
"""Share by which the usual innovation changes with each sighting."""
LEAST, FACTOR = 0.005, 4.0
"""Mean innovation that is too large, m, and as a multiple of the usual one. In the
virtual lab it is exceeded after wrong sightings, or when a paddle squeezes the puck
against a wall and shoots it away: for a few sightings, and rarely."""
LASTING, AGAIN = 12, 100
"""Number of sightings for which the mean must be too large, or within which it must
become so a second time. A second puck does the first. With a camera that was moved by
2 cm, every hit of the paddle is predicted wrongly."""


class Innovations:
    """Innovations of one puck.

    Their usual size is their median, learned over all episodes.
    """

    def __init__(self) -> None:
        self.usual = USUAL
        """Usual innovation, m."""
        self.restart()

    def restart(self) -> None:
        """Begin an episode."""
        self._count = self._above = 0
        self._exceeded, self._again = -AGAIN, False
        self.mean = self.usual
        """Mean of the last innovations, m."""

    def add(self, innovation: Array, since: float) -> None:
        """Add an innovation.

        Args:
            innovation: Sighting minus its prediction (2,), m.
            since: Time since the last sighting, s. An innovation that is larger than
                any puck moves in this time counts in full.
        """
        self._count += 1
        if self._count <= SKIPPED:
            return
        size = float(np.linalg.norm(innovation))
        self.usual *= 1.0 + LEARNING * (1.0 if size > self.usual else -1.0)
        if size < PUCK_SPEED_CAP * since:
            size = min(size, max(LARGEST, MULTIPLE * self.usual))
        self.mean += WEIGHT * (size - self.mean)
        if self.mean <= max(LEAST, FACTOR * self.usual):
            self._above = 0
            return
        if not self._above:
            self._again = self._count - self._exceeded < AGAIN
            self._exceeded = self._count
        self._above += 1

    @property
    def trouble(self) -> str:
        """Reason why the sightings cannot be those of one puck; "" if they can be."""
        if self._above < LASTING and not (self._above and self._again):
            return ""
        return (
            f"puck: seen {1e3 * self.mean:.0f} mm from its prediction, usually "
            f"{1e3 * self.usual:.1f} mm; did the camera move, or is there a second one?"
        )
