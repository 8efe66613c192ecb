"""Occlusion: pucks that an arm hides from the camera.

An arm reaches from the middle of its seat's side to the paddle. Near an arm, a puck
changes between hidden and visible as a Markov chain of two states. Elsewhere it is
always visible.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

SECONDS = 0.1
"""Mean length of an occlusion near an arm (s). In measured play, half of them were
shorter than 17 .. 58 ms, one in ten longer than 92 .. 100 ms."""
NEAR = 0.25
"""Distance from an arm within which it can hide a puck (m). All measured occlusions
were within it, or at the far rail."""


def bases(scene: Scene) -> Array:
    """Return the positions (seats, 2) of the arms: the middles of their sides, m."""
    ends = [scene.table.ends(seat.side) for seat in scene.seats]
    return np.array([(start + end) / 2 for start, end in ends])


@inner(error_model="numpy")
def near_arm(x: float, y: float, bases: Array, paddles: Array) -> bool:
    """Return True for a puck near an arm.

    Args:
        x: Position of the puck along x, m.
        y: Position of the puck along y, m.
        bases: Positions (seats, 2) of the arms, m.
        paddles: Positions (seats, 2) of the paddles, m.
    """
    for s in range(len(bases)):
        along_x, along_y = paddles[s] - bases[s]
        gap_x, gap_y = x - bases[s, 0], y - bases[s, 1]
        square = along_x * along_x + along_y * along_y
        share = (gap_x * along_x + gap_y * along_y) / max(square, 1e-12)
        share = min(max(share, 0.0), 1.0)
        gap_x -= share * along_x
        gap_y -= share * along_y
        if gap_x * gap_x + gap_y * gap_y < NEAR * NEAR:
            return True
    return False


@inner(error_model="numpy")
def stays_visible(visible: bool, share: float, dt: float, unit: float) -> bool:
    """Sample whether a puck near an arm is visible now.

    Args:
        visible: True if the puck was visible in the last step.
        share: Share of the time near an arm in which a puck is hidden.
        dt: Length of a step, s.
        unit: Random number, uniform in [0, 1).
    """
    end = min(dt / SECONDS, 1.0)
    return unit >= end * share / (1.0 - share) if visible else unit < end
