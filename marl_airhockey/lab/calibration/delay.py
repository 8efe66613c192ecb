"""Delay: how late pictures come, and how late the arm, by the arm's own motion.

The arm goes to and fro; the camera sees it. The time by which what is seen has to be
shifted to lie on what the arm reported, or on what it was sent, is a delay. Pictures
count from when they are here, all times are of one clock, and no clocks are compared.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.table import TABLES
from marl_airhockey.devices.camera import Camera, open_source
from marl_airhockey.devices.rig import Rig
from marl_airhockey.devices.robot import Robot
from marl_airhockey.devices.vision import Detector
from marl_airhockey.lab.calibration.camera_session import PADDLE_TOP
from marl_airhockey.lab.calibration.motion import lead
from marl_airhockey.types import Array

AMPLITUDE, PERIOD = 0.09, 1.0
"""Half of the way to and fro, m, and its time, s"""
WINDOW = 1.0
"""Time of a trial, s"""
LEAST_SEEN = 8
"""Pictures with the paddle that a trial needs"""
LONGEST, STEP = 0.4, 0.002
"""Largest delay that is looked for, and the step in which it is, s"""
SETTLE = 1.0
"""Time for which the motion goes on before it is measured, s"""


@dataclass(frozen=True)
class Delays:
    """Delays of n trials, s."""

    camera: Array
    """(n,) from when the paddle was somewhere until a picture of that is here"""
    arm: Array
    """(n,) from when it was sent somewhere until it is there"""

    @property
    def round_trip(self) -> Array:
        """(n,) from a command's effect being sent until it is seen."""
        return self.camera + self.arm


class Watch(threading.Thread):
    """Thread that notes when pictures came, and where the paddle is in them.

    Args:
        camera: that is open.
        detector: of the paddle.
    """

    def __init__(self, camera: Camera, detector: Detector) -> None:
        super().__init__(name="delay", daemon=True)
        self._camera, self._detector = camera, detector
        self._ended = threading.Event()
        self.rows: list[tuple[float, float, float]] = []
        """Time at which a picture was here, s, and x and y, m"""

    def run(self) -> None:
        """Look at all pictures until `stop`."""
        number = -1
        while not self._ended.is_set():
            frame = self._camera.next(number, 0.2)
            if frame is None:
                continue
            number = frame.number
            seen = self._detector.find(frame)
            if seen is not None:
                self.rows.append((frame.arrived, *seen.place.tolist()))

    def stop(self) -> Array:
        """End and return the rows (n, 3)."""
        self._ended.set()
        self.join()
        return np.array(self.rows).reshape(-1, 3)


def measure_delays(
    rig: Rig, trials: int, tell: Callable[[int], None] = lambda done: None
) -> Delays:
    """Move the arm to and fro and return the delays.

    Args:
        rig: of the table.
        trials: number of them, each of `WINDOW`.
        tell: called with the number of trials that are done.

    Raises:
        ValueError: the rig does not know the paddle's colour.
        RuntimeError: the arm stops, or the paddle is not seen.
    """
    if rig.paddle is None:
        raise ValueError(
            "the rig does not know the paddle's colour: calibrate anew, and click it"
        )
    table = TABLES[rig.table]
    reach = make_seat("robot", table, 0).reach
    half_x, half_y = (float(x) for x in table.size / 2)
    parts = rig.view, rig.paddle, table.paddle_radius, (half_x, half_y), PADDLE_TOP
    with (
        Camera(open_source(rig.camera, rig.latency)) as camera,
        Robot(rig.driver_config(reach)) as robot,
    ):
        watch = Watch(camera, Detector(*parts))
        home = np.mean(reach, 0)
        robot.go_to(home)
        watch.start()
        try:
            reported, sent = lead(
                *(robot, home, _sway, SETTLE + trials * WINDOW),
                lambda now: tell(max(int((now - SETTLE) / WINDOW), 0)),
            )
        finally:
            robot.disable()
            seen = watch.stop()
    first = reported[0, 0] + SETTLE
    starts = first + WINDOW * np.arange(trials)
    found = [_trial(seen, reported, sent, start) for start in starts]
    good = np.array([pair for pair in found if pair is not None]).reshape(-1, 2)
    if len(good) < trials / 2:
        raise RuntimeError(
            f"the paddle was seen well enough in {len(good)} of {trials} trials alone"
        )
    return Delays(good[:, 0], good[:, 1] - good[:, 0])


def _sway(now: float) -> tuple[Array, Array]:
    """Return place, m, and velocity, m/s, of the motion to and fro."""
    rate = 2 * np.pi / PERIOD
    place = np.array([0.0, AMPLITUDE * np.sin(rate * now)])
    return place, np.array([0.0, AMPLITUDE * rate * np.cos(rate * now)])


def _trial(
    seen: Array, reported: Array, sent: Array, start: float
) -> tuple[float, float] | None:
    """Return the delay of what is seen behind what was reported, and was sent, s."""
    inside = (seen[:, 0] >= start) & (seen[:, 0] < start + WINDOW)
    if inside.sum() < LEAST_SEEN:
        return None
    return find_delay(seen[inside], reported), find_delay(seen[inside], sent)


def find_delay(late: Array, early: Array) -> float:
    """Return the time by which a motion is behind another one, s.

    A constant distance between them does not count.

    Args:
        late: (n, 3) time, s, and place, m.
        early: (m, 3) the same, over a longer time.
    """
    tried = np.arange(0.0, LONGEST, STEP)
    misfit = np.empty(len(tried))
    for k, delay in enumerate(tried):
        times = late[:, 0] - delay
        places = [np.interp(times, early[:, 0], early[:, axis]) for axis in (1, 2)]
        off = late[:, 1:] - np.stack(places, 1)
        misfit[k] = np.square(off - off.mean(0)).sum()
    k = int(np.clip(np.argmin(misfit), 1, len(tried) - 2))
    # The least of the parabola through the three best.
    before, at, after = misfit[k - 1 : k + 2]
    bend = before - 2 * at + after
    inner = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(tried[k] + STEP * np.clip(inner, -1.0, 1.0))
