"""Estimator: current positions and velocities of pucks, from delayed camera frames.

It is a Kalman filter with a physics model of the table: drag, slope, wall bounces, and
hits by paddles, whose paths are known. Every frame corrects it. The output is the
prediction for now. It compensates latency, noise and short occlusions as far as the
model is correct.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.laws import bounce, fly, wall_restitution
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import GRAVITY
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.jit.elementary import sin
from marl_airhockey.sim.sensing.correction import (
    correct_orientation,
    correct_position,
)
from marl_airhockey.sim.sensing.frame import Newest
from marl_airhockey.sim.sensing.puck_mark import (
    BOUNCE_SPIN,
    HIT_SPIN,
    SPUN,
    MarkReadings,
)
from marl_airhockey.types import Array

STEP = 0.01
"""Longest step of a prediction, s."""
DRIFT = 0.5
"""Noise of the acceleration, m/s2, for errors of the model: unknown slopes and a
calibration error that depends on the position. This value and the next two give the
smallest errors in juggle with the profile ur5e."""
BOUNCE, HIT = 0.08, 0.10
"""Noise of the velocity after a wall bounce and a hit, as a share of the closing
speed."""
FIRST = 0.02
"""Standard deviation of the initial velocity, m/s."""

PARAMETERS = (
    *("puck_damping", "puck_drag", "wall_restitution", "wall_restitution_slope"),
    *("wall_friction", "paddle_restitution", "paddle_friction"),
)
"""Names of the parameters that predictions use in addition to the slopes."""


class Surroundings(NamedTuple):
    """Model of a table for predictions."""

    parameters: Array
    """Centres of the ranges of the parameters (9,): accelerations by the slope along x
    and y, m/s2, then `PARAMETERS`."""
    normals: Array
    """Inward unit normals of the sides (sides, 2)."""
    offsets: Array
    """Distances of the sides from the origin (sides,), m."""
    radius: float
    """Radius of a puck, m."""
    near: float
    """Distance between the centres of a puck and a paddle in contact, m."""
    noise: float
    """Variance of a sensed position, m2."""
    control_dt: float
    """Length of a control step, s."""


class Estimator:
    """Estimator of the pucks of B worlds.

    Args:
        scene: Table and bodies.
        worlds: Number of worlds, B.
        physics: Ranges of the parameters. Their centres are used.
        control_dt: Length of a control step, s.
    """

    def __init__(
        self, scene: Scene, worlds: int, physics: Physics, control_dt: float
    ) -> None:
        middle = {name: sum(pair) / 2 for name, pair in physics.ranges.items()}
        tilts = np.radians([middle["tilt"], middle["cross_tilt"]])
        table, bodies = scene.table, scene.bodies
        # Only changes of the calibration error within a few frames affect a velocity.
        noise = middle["position_noise"] ** 2 + (middle["calibration_error"] / 4) ** 2
        self._known = Surroundings(
            np.array(
                [*(-GRAVITY * sin(tilts)), *(middle[name] for name in PARAMETERS)]
            ),
            table.normals,
            table.offsets,
            table.puck_radius,
            table.puck_radius + table.paddle_radius,
            max(noise, 1e-8),
            control_dt,
        )
        shape = worlds, bodies.pucks
        self._mean, self._spread = np.zeros((*shape, 6)), np.zeros((*shape, 6))
        """Estimates at the last frame (x, y, vx, vy, speed of the edge, orientation).
        Their variance of the position, covariance and variance of the velocity, which
        are equal for both axes, and the same of orientation and spin."""
        self._taken, self._doubted = np.zeros(shape), np.zeros(shape, np.bool_)
        self.now = np.zeros((*shape, 6))
        """Estimates for now (B, pucks, 6): x and y, m; vx, vy and speed of the edge,
        m/s; orientation, rad, which is meaningful for pucks with a mark."""

    @property
    def tracks(self) -> tuple[Array, Array]:
        """Estimates at the last frame of each puck.

        The first array contains the times of the frames (B, pucks), s. The second one
        contains x and y, m, and vx, vy and speed of the edge, m/s, and more
        (B, pucks, 6).
        """
        return self._taken, self._mean

    def reset(self, worlds: Array, seen: Array, velocity: Array, taken: Array) -> None:
        """Reset the estimates of some worlds.

        Args:
            worlds: Indices (W,) of the worlds.
            seen: Sensed positions (W, pucks, 2) of the pucks, m.
            velocity: Velocities (W, pucks, 2) of the pucks, m/s.
            taken: Times (W, pucks) of the sensed positions, s.
        """
        self._mean[worlds] = 0.0
        self._mean[worlds, :, :2], self._mean[worlds, :, 2:4] = seen, velocity
        spun = (SPUN / self._known.radius) ** 2
        self._spread[worlds] = self._known.noise, 0.0, FIRST**2, np.pi**2, 0.0, spun
        self._taken[worlds], self._doubted[worlds] = taken, False

    def update(
        self,
        worlds: Array,
        newest: Newest,
        readings: MarkReadings,
        paddles: Array,
        now: Array,
    ) -> None:
        """Correct the estimates of some worlds by a frame and predict them for now.

        Args:
            worlds: Indices (W,) of the worlds.
            newest: Frame, pucks first.
            readings: Orientations and spins in the frame.
            paddles: Positions (B, steps, S, 2) of the paddles at the last control
                steps, up to now, m.
            now: Current times (B,), s.
        """
        _update(
            *(worlds, newest, readings, paddles, now, self._known),
            *(self._mean, self._spread, self._taken, self._doubted),
            self.now,
        )


@compiled(nogil=True, error_model="numpy")
def _update(
    worlds: Array,
    newest: Newest,
    readings: MarkReadings,
    paddles: Array,
    now: Array,
    known: Surroundings,
    mean: Array,
    spread: Array,
    last: Array,
    doubted: Array,
    shown: Array,
) -> None:
    """Update the arrays of an `Estimator` in place, see `Estimator.update`."""
    (seen, taken, fresh), ahead, wide = newest, np.empty(6), np.empty(6)
    for row in range(len(worlds)):
        w = worlds[row]
        for p in range(mean.shape[1]):
            if fresh[row, p]:
                ahead[:], wide[:] = mean[w, p], spread[w, p]
                since = taken[row] - last[w, p]
                _predict(ahead, wide, last[w, p], since, paddles[w], now[w], known)
                doubted[w, p] = correct_position(
                    ahead, wide, seen[row, p], since, doubted[w, p], known.noise
                )
                if readings.read[row, p] and not doubted[w, p]:
                    correct_orientation(ahead, wide, readings, row, p, known.radius)
                if not doubted[w, p]:
                    mean[w, p], spread[w, p], last[w, p] = ahead, wide, taken[row]
            ahead[:], wide[:] = mean[w, p], spread[w, p]
            since = now[w] - last[w, p]
            _predict(ahead, wide, last[w, p], since, paddles[w], now[w], known)
            shown[w, p] = ahead


@compiled(nogil=True, error_model="numpy")
def _predict(
    mean: Array,
    spread: Array,
    begin: float,
    seconds: float,
    paddles: Array,
    now: float,
    known: Surroundings,
) -> None:
    """Predict an estimate in place.

    Args:
        mean: Estimate (6,), see `Estimator.now`.
        spread: Variance of the position, covariance and variance of the velocity, and
            the same of orientation and spin (6,).
        begin: Time of the estimate, s.
        seconds: Duration of the prediction, s.
        paddles: Positions (n, S, 2) of the paddles at the last control steps, up to
            now, m.
        now: Current time, s.
        known: Model of the table.
    """
    values, steps = known.parameters, int(np.ceil(seconds / STEP))
    h = seconds / max(steps, 1)
    for k in range(steps):
        dx, dy, mean[2], mean[3] = fly(
            mean[2], mean[3], h, values[0], values[1], values[2], values[3]
        )
        mean[0] += dx
        mean[1] += dy
        spread[0] += h * (2.0 * spread[1] + h * spread[2])
        spread[1] += h * spread[2]
        spread[2] += (DRIFT * h) ** 2
        mean[5] += h * mean[4] / known.radius
        spread[3] += h * (2.0 * spread[4] + h * spread[5])
        spread[4] += h * spread[5]
        for side in range(len(known.offsets)):
            nx, ny = known.normals[side]
            beyond = known.offsets[side] + nx * mean[0] + ny * mean[1] - known.radius
            closing = -(nx * mean[2] + ny * mean[3])
            if beyond < 0.0 and closing > 0.0:
                e = wall_restitution(closing, values[4], values[5])
                bounce(mean, nx, ny, closing, 0.0, e, values[6])
                # The puck covers the distance beyond the wall again at its new speed.
                mean[0] -= (1.0 + e) * beyond * nx
                mean[1] -= (1.0 + e) * beyond * ny
                spread[2] += (BOUNCE * closing) ** 2
                spread[5] += (BOUNCE_SPIN * closing / known.radius) ** 2
        back = (now - begin - (k + 1) * h) / known.control_dt
        _meet(mean, spread, paddles, back, known)


@inner(error_model="numpy")
def _meet(
    mean: Array, spread: Array, paddles: Array, back: float, known: Surroundings
) -> None:
    """Apply contacts of a puck with the paddles, ``back`` control steps ago."""
    last = len(paddles) - 1
    new = max(last - int(back), 1)
    share = min(max(last - back - (new - 1), 0.0), 1.0)
    for s in range(paddles.shape[1]):
        wx = paddles[new, s, 0] - paddles[new - 1, s, 0]
        wy = paddles[new, s, 1] - paddles[new - 1, s, 1]
        gx = mean[0] - paddles[new - 1, s, 0] - share * wx
        gy = mean[1] - paddles[new - 1, s, 1] - share * wy
        gap = np.sqrt(gx * gx + gy * gy)
        if gap >= known.near or gap == 0.0:
            continue
        nx, ny = gx / gap, gy / gap
        wx, wy = wx / known.control_dt, wy / known.control_dt
        closing = nx * (wx - mean[2]) + ny * (wy - mean[3])
        # The puck covers the distance into the paddle again, too.
        back_out = known.near - gap
        if closing > 0.0:
            along = nx * wy - ny * wx
            bounce(
                mean, nx, ny, closing, along, known.parameters[7], known.parameters[8]
            )
            spread[2] += (HIT * closing) ** 2
            spread[5] += (HIT_SPIN * closing / known.radius) ** 2
            back_out *= 1.0 + known.parameters[7]
        mean[0] += back_out * nx
        mean[1] += back_out * ny
