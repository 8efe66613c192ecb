"""Occlusion: pucks that an arm hides from the camera."""

from __future__ import annotations

import numpy as np

from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.types import Array, Rows

SECONDS = 0.1
"""Mean length of an occlusion near an arm (s). In measured play, half of them were
shorter than 17 .. 58 ms, one in ten longer than 92 .. 100 ms."""
NEAR = 0.25
"""Distance from an arm within which it can hide a puck (m). All measured occlusions
were within it, or at the far rail."""


class Occlusion:
    """Occlusion of the pucks of B worlds.

    An arm reaches from the middle of its seat's side to the paddle. Near an arm, a puck
    changes between hidden and visible as a Markov chain of two states. Elsewhere it is
    always visible.

    Args:
        scene: Scene whose seats have the arms.
        worlds: Number of worlds, B.
        control_dt: Time between two steps, s.
    """

    def __init__(self, scene: Scene, worlds: int, control_dt: float) -> None:
        self._visible = np.ones((worlds, scene.pucks), np.bool_)
        self._end = min(control_dt / SECONDS, 1.0)
        ends = [scene.table.ends(seat.side) for seat in scene.seats]
        self._bases = np.array([(start + end) / 2 for start, end in ends])

    def reset(self, worlds: Array) -> None:
        """Make all pucks visible in some worlds, by index."""
        self._visible[worlds] = True

    def near(self, pucks: Array, paddles: Array) -> Array:
        """Return (W, pucks) bool, True for pucks near an arm.

        Args:
            pucks: Positions (W, pucks, 2), m.
            paddles: Positions (W, seats, 2), m.
        """
        along = (paddles - self._bases)[:, None]
        gap = pucks[:, :, None] - self._bases
        share = (gap * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-12)
        gap -= np.clip(share, 0.0, 1.0)[..., None] * along
        return np.asarray((gap * gap).sum(-1).min(-1) < NEAR * NEAR)

    def sample_visible(
        self,
        pucks: Array,
        paddles: Array,
        share: Array,
        rng: RandomStreams,
        rows: Rows,
    ) -> Array:
        """Sample which pucks are visible in some worlds (W,), (W, pucks) bool.

        Args:
            pucks: Positions (W, pucks, 2), m.
            paddles: Positions (W, seats, 2), m.
            share: Share (W,) of the time near an arm in which a puck is hidden.
            rng: Streams of these worlds.
            rows: Worlds.
        """
        begin = (self._end * share / (1.0 - share))[:, None]
        unit = rng.uniform(0.0, 1.0, pucks.shape[1])
        visible = np.where(self._visible[rows], unit >= begin, unit < self._end)
        self._visible[rows] = visible | ~self.near(pucks, paddles)
        return np.asarray(self._visible[rows])
