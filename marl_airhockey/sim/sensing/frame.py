"""Frame of a simulated camera: sensed positions of the bodies of a world, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.rng import normal_pair
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.sensing.calibration import Waves, shift
from marl_airhockey.sim.sensing.delay import append, position_before
from marl_airhockey.sim.sensing.occlusion import near_arm, stays_visible
from marl_airhockey.types import Array

SAME_FRAME = 1e-4
"""Largest time between two readings of the same frame (s)."""


class CameraPast(NamedTuple):
    """Past of n tracked bodies in B worlds, and the last frames of their cameras."""

    past: Array
    """Positions, m, and velocities, m/s, at control steps (B, depth, n, 4)."""
    paddles: Array
    """Positions of the paddles at control steps (B, steps, seats, 2), m."""
    waves: Waves
    """Calibration error."""
    unhidden: Array
    """True for pucks that no arm hides (B, pucks)."""
    seen: Array
    """Sensed position, m, and velocity, m/s, in the last frame in which a body was
    visible (B, n, 4)."""
    taken: Array
    """Time of that frame (B, n), s."""
    visible: Array
    """True for pucks that are detected in the newest frame, at the right or at a wrong
    position (B, pucks)."""
    bases: Array
    """Positions of the arms (seats, 2), m."""
    extent: Array
    """Largest x and y of the table (2,), m."""
    control_dt: float
    """Length of a control step, s."""


class Errors(NamedTuple):
    """Parameters (B,) of sensing in B worlds."""

    observation_delay: Array
    observation_jitter: Array
    position_noise: Array
    occlusion: Array
    false_detection: Array


class Newest(NamedTuple):
    """Newest frames of W worlds."""

    position: Array
    """Sensed positions (W, n, 2), m."""
    taken: Array
    """Times of the frames (W,), s."""
    fresh: Array
    """True for bodies that are visible in a new frame (W, n)."""

    @staticmethod
    def empty(worlds: int, tracked: int) -> Newest:
        """Return arrays for `take` to fill."""
        fresh = np.empty((worlds, tracked), np.bool_)
        return Newest(np.empty((worlds, tracked, 2)), np.empty(worlds), fresh)


def numbers(tracked: int, pucks: int) -> int:
    """Return the number of random numbers that a frame needs."""
    return 1 + 4 * tracked + 4 * pucks


@compiled(nogil=True, error_model="numpy")
def take(
    worlds: Array,
    units: Array,
    position: Array,
    velocity: Array,
    time: Array,
    errors: Errors,
    view: CameraPast,
    newest: Newest,
) -> None:
    """Take a frame of some worlds: fill ``newest`` and update ``view``.

    Args:
        worlds: Indices (W,) of the worlds.
        units: Random numbers (W, `numbers`), uniform in [0, 1).
        position: Positions (B, N, 2) of paddles, pucks and blocks, m.
        velocity: Velocities (B, N, 2) of paddles, pucks and blocks, m/s.
        time: Current times (B,), s.
        errors: Parameters of sensing.
        view: Past and last frame.
        newest: Newest frame.
    """
    tracked, pucks, seats = view.seen.shape[1], view.visible.shape[1], len(view.bases)
    for row in range(len(worlds)):
        w, unit = worlds[row], units[row]
        age = errors.observation_delay[w] + errors.observation_jitter[w] * unit[0]
        newest.taken[row] = time[w] - age
        append(view.paddles[w], position[w, :seats])
        append(view.past[w, :, :, :2], position[w, seats : seats + tracked])
        append(view.past[w, :, :, 2:], velocity[w, seats : seats + tracked])
        for k in range(tracked):
            x, y = position_before(view.past[w, :, k], age, view.control_dt)
            here = shift(view.waves, w, x, y)
            for axis in range(2):
                first = 1 + 2 * k + axis
                noise, _ = normal_pair(unit[first], unit[first + 2 * tracked])
                at = here[axis] + errors.position_noise[w] * noise
                newest.position[row, k, axis] = at
            if k < pucks:
                _detect(w, k, x, y, unit[1 + 4 * tracked :], errors, view, newest, row)
            visible = view.visible[w, k] if k < pucks else True
            since = newest.taken[row] - view.taken[w, k]
            newest.fresh[row, k] = visible and since > SAME_FRAME
            if newest.fresh[row, k]:
                for axis in range(2):
                    at = newest.position[row, k, axis]
                    view.seen[w, k, 2 + axis] = (at - view.seen[w, k, axis]) / since
                    view.seen[w, k, axis] = at
                view.taken[w, k] = newest.taken[row]


@inner(error_model="numpy")
def _detect(
    w: int,
    k: int,
    x: float,
    y: float,
    unit: Array,
    errors: Errors,
    view: CameraPast,
    newest: Newest,
    row: int,
) -> None:
    """Hide a puck at x, y, or detect it at a wrong position."""
    pucks, share = view.visible.shape[1], errors.occlusion[w]
    visible = stays_visible(view.unhidden[w, k], share, view.control_dt, unit[k])
    near = near_arm(x, y, view.bases, view.paddles[w, -1])
    view.unhidden[w, k] = visible or not near
    wrong = unit[pucks + k] < errors.false_detection[w]
    if wrong:
        for axis in range(2):
            elsewhere = 2.0 * unit[2 * pucks + 2 * k + axis] - 1.0
            newest.position[row, k, axis] = view.extent[axis] * elsewhere
    view.visible[w, k] = view.unhidden[w, k] or wrong
