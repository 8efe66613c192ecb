"""Corrections of a predicted puck by a frame, for the `Estimator`."""

from __future__ import annotations

from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.sim.sensing.puck_mark import MarkReadings, wrapped
from marl_airhockey.types import Array

ABRUPT = 2.5
"""Velocity change above which a second frame must confirm it, m/s."""
STRANGE = 9.0
"""Squared error, in variances of the prediction, above which the filter assumes that an
unmodelled event has changed the velocity."""
LOST = 0.25
"""Variance of a predicted orientation, rad2, above which a measured one replaces it."""


@inner(error_model="numpy")
def correct_position(
    mean: Array, spread: Array, seen: Array, since: float, doubted: bool, noise: float
) -> bool:
    """Correct a prediction by a sensed position; return True if it is doubtful."""
    dx, dy = seen[0] - mean[0], seen[1] - mean[1]
    off = dx * dx + dy * dy
    if off > (ABRUPT * since) ** 2 and not doubted:
        return True
    if off > 2.0 * STRANGE * (spread[0] + noise):
        # Assume that the velocity changed some time after the last frame.
        change = off / (since * since)
        spread[2] += change
        spread[1] += change * since
        spread[0] += off
    gain_x, gain_v = spread[0] / (spread[0] + noise), spread[1] / (spread[0] + noise)
    mean[0] += gain_x * dx
    mean[1] += gain_x * dy
    mean[2] += gain_v * dx
    mean[3] += gain_v * dy
    spread[2] -= gain_v * spread[1]
    spread[1] -= gain_v * spread[0]
    spread[0] -= gain_x * spread[0]
    return False


@inner(error_model="numpy")
def correct_orientation(
    mean: Array, spread: Array, readings: MarkReadings, row: int, p: int, radius: float
) -> None:
    """Correct a prediction of the `Estimator` by a measured orientation and spin.

    The spin comes first: it is not ambiguous, and it bounds the error of the predicted
    orientation in the next frame.
    """
    variance, now = max(readings.noise[row] ** 2, 1e-6), mean[4] / radius
    noise = 2.0 * variance / readings.span[row] ** 2
    off, total = readings.spin[row, p] - now, spread[5] + noise
    mean[5] += spread[4] / total * off
    now += spread[5] / total * off
    spread[3] -= spread[4] * spread[4] / total
    spread[4] *= noise / total
    spread[5] *= noise / total
    if spread[3] + variance > LOST:
        mean[5], spread[3], spread[4] = readings.angle[row, p], variance, 0.0
    else:
        off, total = wrapped(readings.angle[row, p] - mean[5]), spread[3] + variance
        mean[5] += spread[3] / total * off
        now += spread[4] / total * off
        spread[5] -= spread[4] * spread[4] / total
        spread[4] *= variance / total
        spread[3] *= variance / total
    mean[4] = now * radius
