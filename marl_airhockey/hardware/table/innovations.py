"""Innovations: distances of a puck's sightings from the predictions of its filter."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array

SKIPPED = 8
"""Number of ignored first sightings, as the velocity is not known yet."""
WEIGHT = 0.1
"""Weight of the newest innovation in their mean."""
LARGEST, MULTIPLE = 0.03, 20.0
"""Largest value that an innovation counts with, m, and as a multiple of the usual one.
One wrong sighting then adds at most 3 mm, or twice the usual innovation, to the mean,
which is not enough."""
USUAL = 0.001
"""First value of the usual innovation, m."""
LEARNING = 0.02
"""Share by which the usual innovation changes with each sighting."""
LEAST, FACTOR = 0.005, 4.0
"""Mean innovation that is too large, m, and as a multiple of the usual one. In the
virtual lab the mean stays below 3 mm; it reaches 7 mm when the camera is moved by
2 cm."""


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
        self._count, self.mean = 0, self.usual
        """Mean of the last innovations, m."""

    def add(self, innovation: Array) -> None:
        """Add an innovation (2,), m."""
        self._count += 1
        if self._count <= SKIPPED:
            return
        size = float(np.linalg.norm(innovation))
        self.usual *= 1.0 + LEARNING * (1.0 if size > self.usual else -1.0)
        largest = max(LARGEST, MULTIPLE * self.usual)
        self.mean += WEIGHT * (min(size, largest) - self.mean)

    @property
    def trouble(self) -> str:
        """Reason why the sightings cannot be those of one puck; "" if they can be."""
        if self.mean <= max(LEAST, FACTOR * self.usual):
            return ""
        return (
            f"puck: seen {1e3 * self.mean:.0f} mm from its prediction, usually "
            f"{1e3 * self.usual:.1f} mm; did the camera move, or is there a second one?"
        )
