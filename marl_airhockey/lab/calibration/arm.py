"""Arm: how it follows what it is sent, by steps and chirps.

What it was sent goes through a model, a dead time and then a critically damped lag of
second order (`core.servo`, which simulated arms have), and the two numbers of the
model are those whose answer lies on what the arm reported. The gain and the phase at
some frequencies, without any model, say whether it fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.servo import HALF, follow_ramp
from marl_airhockey.core.table import TABLES
from marl_airhockey.devices.rig import Rig
from marl_airhockey.devices.robot import Robot
from marl_airhockey.lab.calibration.motion import Motion, lead
from marl_airhockey.types import Array

STEP_SPEED, STEP_SECONDS = 0.4, 0.4
"""Speed of the steps to and fro, m/s, and how long each lasts, s"""
STEPS = 16
"""Number of steps of a trial"""
CHIRP_SPEED = 0.25
"""Largest speed of a chirp, m/s"""
CHIRP = (0.5, 5.0)
"""Its frequencies, Hz"""
CHIRP_SECONDS = 12.0
"""Time in which it goes from one to the other, s"""
GRID = 0.001
"""Time between the samples with which the model is computed, s"""
FIRST, NUDGE = (0.01, 0.06), 1e-4
"""Dead time and half-rise from which they are looked for, and the step of slopes, s"""
LONGEST = 0.4
"""Largest of them, s"""
SETTLE = 0.5
"""Time after which the beginning is forgotten, s"""
FREQUENCIES = (1.0, 2.0, 3.0, 4.0)
"""Frequencies at which gain and phase are told, Hz"""
Path = Callable[[float], tuple[Array, Array]]


@dataclass(frozen=True)
class ArmTrial:
    """Trial of one motion along one axis."""

    motion: str
    """``steps`` or ``chirp``"""
    axis: str
    """``x`` or ``y`` of the table frame"""
    action_delay: float
    """Dead time, s"""
    servo_time: float
    """Time in which the lag makes half of a step, s"""
    misfit: float
    """Root mean square of what the model leaves, m"""
    response: dict[float, tuple[float, float]]
    """Gain, and phase in degrees, by frequency, Hz; of chirps"""


def measure_arm(
    rig: Rig,
    repeats: int = 2,
    tell: Callable[[int], None] = lambda done: None,
) -> list[ArmTrial]:
    """Move the arm by steps and chirps along both axes; return what is found in each.

    Args:
        rig: of the table.
        repeats: number of times that each motion is made.
        tell: called with the number of trials that are done.

    Raises:
        RuntimeError: the arm stops.
    """
    reach = make_seat("robot", TABLES[rig.table], 0).reach
    home, found = np.mean(reach, 0), []
    kinds = {"steps": (steps, STEPS * STEP_SECONDS), "chirp": (chirp, CHIRP_SECONDS)}
    with Robot(rig.driver_config(reach)) as robot:
        for _, axis, (name, (path, seconds)) in product(
            range(repeats), (0, 1), kinds.items()
        ):
            robot.go_to(home)
            motion = lead(robot, home, along(path, axis), seconds)
            found.append(find_lag(motion, axis, name))
            tell(len(found))
    return found


def along(path: Callable[[float], tuple[float, float]], axis: int) -> Path:
    """Return a path along an axis."""
    way = np.eye(2)[axis]

    def at(now: float) -> tuple[Array, Array]:
        place, speed = path(now)
        return place * way, speed * way

    return at


def steps(now: float) -> tuple[float, float]:
    """Return place, m, and velocity, m/s, of steps of the velocity to and fro."""
    count, part = divmod(now + STEP_SECONDS / 2, STEP_SECONDS)
    sign = 1.0 if count % 2 == 0 else -1.0
    place = sign * STEP_SPEED * (part - STEP_SECONDS / 2)
    return place, sign * STEP_SPEED


def chirp(now: float) -> tuple[float, float]:
    """Return place, m, and velocity, m/s, of a motion to and fro ever faster."""
    first, last = CHIRP
    growth = np.log(last / first) / CHIRP_SECONDS
    frequency = first * np.exp(growth * now)
    phase = 2 * np.pi * (frequency - first) / growth
    size = CHIRP_SPEED / (2 * np.pi * frequency)
    return float(size * np.sin(phase)), float(CHIRP_SPEED * np.cos(phase))


def find_lag(motion: Motion, axis: int, name: str) -> ArmTrial:
    """Return the trial that a motion along an axis was.

    Args:
        motion: reported and sent, from rest on.
        axis: 0 for x, 1 for y.
        name: of the motion.
    """
    sent, reported = (rows[:, [0, 1 + axis]] for rows in (motion.sent, motion.reported))
    # What it was sent before the first row is not known: it rested there.
    began = sent[0, 0] + SETTLE
    times = np.arange(sent[0, 0], min(sent[-1, 0], reported[-1, 0]), GRID)
    given = np.interp(times, *sent.T)
    wanted = reported[(reported[:, 0] >= began) & (reported[:, 0] <= times[-1])]

    def off(times_of: Array) -> Array:
        dead, half = times_of
        answer = np.interp(wanted[:, 0] - dead, times, _lagged(given, float(half)))
        return np.asarray(answer - wanted[:, 1])

    best = _least(off)
    response = {}
    if name == "chirp":
        seen = np.interp(times, *reported.T)
        response = {f: _response(given, seen, f) for f in FREQUENCIES}
    misfit = float(np.sqrt(np.mean(np.square(off(best)))))
    dead, half = (float(value) for value in best)
    return ArmTrial(name, "xy"[axis], dead, half, misfit, response)


def _lagged(given: Array, half: float) -> Array:
    """Return the answer of the critically damped lag to samples of a place."""
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
    """Return the dead time and the half-rise (2,), s, of least squares of ``off``.

    By Levenberg and Marquardt's method.
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
    """Return gain and phase, degrees, of a chirp's answer about a frequency, Hz."""
    first, last = CHIRP
    growth = np.log(last / first) / CHIRP_SECONDS
    middle = np.log(frequency / first) / growth
    times = GRID * np.arange(len(given))
    # Half an octave of the sweep.
    window = np.exp(-(((times - middle) * growth / 0.17) ** 2))
    parts = [np.gradient(rows, GRID) * window for rows in (given, seen)]
    spectra = [np.fft.rfft(part) for part in parts]
    near = np.abs(np.fft.rfftfreq(len(given), GRID) / frequency - 1.0) < 0.12
    cross = (spectra[1] * np.conj(spectra[0]))[near].sum()
    power = (np.abs(spectra[0]) ** 2)[near].sum()
    return float(np.abs(cross / power)), float(np.degrees(np.angle(cross)))
