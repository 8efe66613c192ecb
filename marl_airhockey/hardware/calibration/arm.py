"""Identification of an arm's response to commands, by steps and chirps.

The model is a dead time followed by a critically damped lag of second order, as for
simulated arms (`core.servo`). A least-squares fit of the reported positions to the
model's response gives both parameters. Gain and phase at some frequencies, which need
no model, show whether the model fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from marl_airhockey.hardware.calibration.motion import RecordedMotion, lead
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import Robot
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.servo import HALF, follow_ramp
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

STEP_SPEED, STEP_SECONDS = 0.4, 0.4
"""Speed of the steps back and forth, m/s, and time of each step, s."""
STEPS = 16
"""Number of steps of a trial."""
CHIRP_SPEED = 0.25
"""Largest speed of a chirp, m/s."""
CHIRP = (0.5, 5.0)
"""First and last frequency of a chirp, Hz."""
CHIRP_SECONDS = 12.0
"""Time of a chirp, s."""
GRID = 0.001
"""Time between the samples of the model's response, s."""
FIRST, NUDGE = (0.01, 0.06), 1e-4
"""Initial dead time and half-rise time of the fit, and the step of its finite
differences, s."""
LONGEST = 0.4
"""Largest dead time and half-rise time, s."""
SETTLE = 0.5
"""Time of the motion before the fitted part, s."""
FREQUENCIES = (1.0, 2.0, 3.0, 4.0)
"""Frequencies at which gain and phase are reported, Hz."""
Path = Callable[[float], tuple[Array, Array]]


@dataclass(frozen=True)
class ArmTrial:
    """Result of one motion along one axis."""

    motion: str
    """``steps`` or ``chirp``."""
    axis: str
    """``x`` or ``y`` of the table frame."""
    action_delay: float
    """Dead time, s."""
    servo_time: float
    """Time to 50 % of a step of the lag, s."""
    misfit: float
    """Root mean square residual of the model, m."""
    response: dict[float, tuple[float, float]]
    """Gain and phase, deg, by frequency, Hz; empty for steps."""

    @property
    def lag(self) -> float:
        """Time by which the arm lags at constant velocity, s (`ServoSettings.lag`).

        It is the dead time plus 2 / w of a critically damped lag of frequency w.
        """
        return self.action_delay + 2.0 * self.servo_time / HALF


def measure_arm(
    rig: Rig,
    repeats: int = 2,
    tell: Callable[[int], None] = lambda done: None,
) -> list[ArmTrial]:
    """Move the arm by steps and chirps along both axes; return the result of each.

    Args:
        rig: Rig of the table.
        repeats: Number of repetitions of each motion.
        tell: Function that is called with the number of finished motions.

    Raises:
        RuntimeError: The arm stops.
    """
    reach = make_seat("robot", TABLES[rig.table], 0).reach
    home, found = np.mean(reach, 0), []
    kinds = {"steps": (steps, STEPS * STEP_SECONDS), "chirp": (chirp, CHIRP_SECONDS)}
    with Robot(rig.robot_config(reach)) as robot:
        for _, axis, (name, (path, seconds)) in product(
            range(repeats), (0, 1), kinds.items()
        ):
            robot.go_to(home)
            motion = lead(robot, home, along(path, axis), seconds)
            found.append(find_lag(motion, axis, name))
            tell(len(found))
    return found


def along(path: Callable[[float], tuple[float, float]], axis: int) -> Path:
    """Return a path in the plane from a path along an axis.

    Args:
        path: Function of the time, s, that returns position, m, and velocity, m/s.
        axis: 0 for x, 1 for y.
    """
    direction = np.eye(2)[axis]

    def at(now: float) -> tuple[Array, Array]:
        position, speed = path(now)
        return position * direction, speed * direction

    return at


def steps(now: float) -> tuple[float, float]:
    """Return position, m, and velocity, m/s, of velocity steps back and forth."""
    count, part = divmod(now + STEP_SECONDS / 2, STEP_SECONDS)
    sign = 1.0 if count % 2 == 0 else -1.0
    position = sign * STEP_SPEED * (part - STEP_SECONDS / 2)
    return position, sign * STEP_SPEED


def chirp(now: float) -> tuple[float, float]:
    """Return position, m, and velocity, m/s, of an oscillation of rising frequency."""
    first, last = CHIRP
    growth = np.log(last / first) / CHIRP_SECONDS
    frequency = first * np.exp(growth * now)
    phase = 2 * np.pi * (frequency - first) / growth
    size = CHIRP_SPEED / (2 * np.pi * frequency)
    return float(size * np.sin(phase)), float(CHIRP_SPEED * np.cos(phase))


def find_lag(motion: RecordedMotion, axis: int, name: str) -> ArmTrial:
    """Fit the model to a motion along an axis.

    Args:
        motion: Reported and sent motion, which begins at rest.
        axis: 0 for x, 1 for y.
        name: Name of the motion, ``steps`` or ``chirp``.
    """
    sent, reported = (rows[:, [0, 1 + axis]] for rows in (motion.sent, motion.reported))
    # Commands before the first row are unknown; the arm was at rest.
    began = sent[0, 0] + SETTLE
    times = np.arange(sent[0, 0], min(sent[-1, 0], reported[-1, 0]), GRID)
    given = np.interp(times, *sent.T)
    fitted = reported[(reported[:, 0] >= began) & (reported[:, 0] <= times[-1])]

    def off(times_of: Array) -> Array:
        dead, half = times_of
        answer = np.interp(fitted[:, 0] - dead, times, _lagged(given, float(half)))
        return np.asarray(answer - fitted[:, 1])

    best = _least(off)
    response = {}
    if name == "chirp":
        seen = np.interp(times, *reported.T)
        response = {f: _response(given, seen, f) for f in FREQUENCIES}
    misfit = float(np.sqrt(np.mean(np.square(off(best)))))
    dead, half = (float(value) for value in best)
    return ArmTrial(name, "xy"[axis], dead, half, misfit, response)


def _lagged(given: Array, half: float) -> Array:
    """Return the response of the critically damped lag to sampled positions.

    Args:
        given: Commanded positions (n,), `GRID` apart, m.
        half: Time to 50 % of a step, s.
    """
    w = HALF / max(half, 1e-4)
    left = np.exp(-w * GRID)
    answer = np.empty_like(given)
    answer[0], speed = given[0], 0.0
    for k in range(1, len(given)):
        answer[k], speed = follow_ramp(
            given[k - 1], given[k], answer[k - 1], speed, w, left, GRID
        )
    return answer


def _least(off: Callable[[Array], Array]) -> Array:
    """Return dead time and half-rise time (2,), s, with the least squares of ``off``.

    It uses the Levenberg-Marquardt method.
    """
    found, damping = np.array(FIRST), 1e-3
    rows = off(found)
    for _ in range(30):
        slopes = [(off(found + step) - rows) / NUDGE for step in NUDGE * np.eye(2)]
        matrix = np.stack(slopes, 1)
        normal = matrix.T @ matrix
        normal += damping * np.diag(np.diag(normal))
        tried = found - np.linalg.solve(normal, matrix.T @ rows)
        tried = np.clip(tried, 0.0, LONGEST)
        better = off(tried)
        if np.square(better).sum() < np.square(rows).sum():
            done = np.abs(tried - found).max() < 1e-6
            found, rows, damping = tried, better, damping / 5
            if done:
                break
        else:
            damping *= 5
    return found


def _response(given: Array, seen: Array, frequency: float) -> tuple[float, float]:
    """Return gain and phase, deg, of the response to a chirp near a frequency, Hz."""
    first, last = CHIRP
    growth = np.log(last / first) / CHIRP_SECONDS
    middle = np.log(frequency / first) / growth
    times = GRID * np.arange(len(given))
    # The window covers half an octave of the chirp.
    window = np.exp(-(((times - middle) * growth / 0.17) ** 2))
    parts = [np.gradient(rows, GRID) * window for rows in (given, seen)]
    spectra = [np.fft.rfft(part) for part in parts]
    near = np.abs(np.fft.rfftfreq(len(given), GRID) / frequency - 1.0) < 0.12
    cross = (spectra[1] * np.conj(spectra[0]))[near].sum()
    power = (np.abs(spectra[0]) ** 2)[near].sum()
    return float(np.abs(cross / power)), float(np.degrees(np.angle(cross)))
