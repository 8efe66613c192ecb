"""Latency of the camera and of the arm, measured by a motion of the arm.

The arm moves back and forth under the camera. A delay is the time shift of the observed
motion to the reported or to the sent motion. A frame counts at the time of its arrival.
All times are of the same clock.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from marl_airhockey.hardware.calibration.motion import lead
from marl_airhockey.hardware.camera import Camera, CameraFrame, open_source
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot import Robot
from marl_airhockey.hardware.vision import Detector
from marl_airhockey.sim.contracts.camera_model import PADDLE_TOP
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

AMPLITUDE, PERIOD = 0.09, 1.0
"""Amplitude, m, and period, s, of the motion."""
WINDOW = 1.0
"""Time of a trial, s."""
LEAST_SEEN = 8
"""Least number of frames with the paddle in a trial."""
LONGEST, STEP = 0.4, 0.002
"""Largest delay of the search, and its step, s."""
SETTLE = 1.0
"""Time of the motion before the first trial, s."""


@dataclass(frozen=True)
class Delays:
    """Delays of n trials, s, and the times of the frames."""

    camera: Array
    """Times (n,) from a position of the paddle until its frame has arrived."""
    arm: Array
    """Times (n,) from a commanded position until the arm has reached it."""
    period: float
    """Time between two frames, s."""
    dropped: float
    """Share of the frames that did not arrive."""

    @property
    def round_trip(self) -> Array:
        """Times (n,) from a commanded position until its frame has arrived, s."""
        return self.camera + self.arm


def frame_times(frames: Sequence[CameraFrame]) -> tuple[float, float]:
    """Return the time between two frames, s, and the share that did not arrive.

    Args:
        frames: At least two frames, in the order of their arrival.
    """
    numbers = np.array([frame.number for frame in frames])
    taken = np.array([frame.taken for frame in frames])
    steps = np.diff(numbers)
    count = numbers[-1] - numbers[0] + 1
    return float(np.median(np.diff(taken) / steps)), float(1.0 - len(frames) / count)


class Watch(threading.Thread):
    """Thread that records the arrival of frames and the paddle's position in them.

    Args:
        camera: Open camera.
        detector: Detector of the paddle.
    """

    def __init__(self, camera: Camera, detector: Detector) -> None:
        super().__init__(name="delay", daemon=True)
        self._camera, self._detector = camera, detector
        self._ended = threading.Event()
        self.rows: list[tuple[float, float, float]] = []
        """Arrival time of a frame, s, and x and y of the paddle, m."""

    def run(self) -> None:
        """Search all frames until `stop`."""
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
        """End the thread and return the rows (n, 3)."""
        self._ended.set()
        self.join()
        return np.array(self.rows).reshape(-1, 3)


def measure_delays(
    rig: Rig, trials: int, tell: Callable[[int], None] = lambda done: None
) -> Delays:
    """Move the arm back and forth and return the delays.

    Args:
        rig: Rig of the table.
        trials: Number of trials, each of `WINDOW` seconds.
        tell: Function that is called with the number of finished trials.

    Raises:
        ValueError: The rig has no colour of the paddle.
        RuntimeError: The arm stops, or the paddle is not seen.
    """
    if rig.paddle is None:
        raise ValueError(
            "the rig has no colour of the paddle; calibrate again, and click the paddle"
        )
    table = TABLES[rig.table]
    reach = make_seat("robot", table, 0).reach
    half_x, half_y = (float(x) for x in table.size / 2)
    parts = rig.view, rig.paddle, table.paddle_radius, (half_x, half_y), PADDLE_TOP
    with (
        Camera(open_source(rig.camera, rig.latency)) as camera,
        Robot(rig.robot_config(reach)) as robot,
    ):
        watch, frames = Watch(camera, Detector(*parts)), list[CameraFrame]()
        camera.listeners.append(lambda frame: frames.append(_without_image(frame)))
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
            f"the paddle was seen in only {len(good)} of {trials} trials; check the "
            "light, its colour in the rig, and what hides it"
        )
    return Delays(good[:, 0], good[:, 1] - good[:, 0], *frame_times(frames))


def _without_image(frame: CameraFrame) -> CameraFrame:
    return frame._replace(image=np.zeros(0, np.uint8))


def _sway(now: float) -> tuple[Array, Array]:
    """Return offset (2,), m, and velocity (2,), m/s, of the motion at a time, s."""
    rate = 2 * np.pi / PERIOD
    offset = np.array([0.0, AMPLITUDE * np.sin(rate * now)])
    return offset, np.array([0.0, AMPLITUDE * rate * np.cos(rate * now)])


def _trial(
    seen: Array, reported: Array, sent: Array, start: float
) -> tuple[float, float] | None:
    """Return the delays of the observed motion to the reported and the sent one, s.

    Return None if the paddle is seen in too few frames.
    """
    inside = (seen[:, 0] >= start) & (seen[:, 0] < start + WINDOW)
    if inside.sum() < LEAST_SEEN:
        return None
    return find_delay(seen[inside], reported), find_delay(seen[inside], sent)


def find_delay(late: Array, early: Array) -> float:
    """Return the delay of a motion to another one, s.

    A constant offset between their positions is ignored.

    Args:
        late: Times, s, and positions, m, of the delayed motion (n, 3).
        early: Times, s, and positions, m, of the other motion (m, 3), over a longer
            time.
    """
    tried = np.arange(0.0, LONGEST, STEP)
    misfit = np.empty(len(tried))
    for k, delay in enumerate(tried):
        times = late[:, 0] - delay
        shifted = [np.interp(times, early[:, 0], early[:, axis]) for axis in (1, 2)]
        off = late[:, 1:] - np.stack(shifted, 1)
        misfit[k] = np.square(off - off.mean(0)).sum()
    k = int(np.clip(np.argmin(misfit), 1, len(tried) - 2))
    # The minimum of a parabola through the best delay and its neighbours.
    before, at, after = misfit[k - 1 : k + 2]
    bend = before - 2 * at + after
    inner = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(tried[k] + STEP * np.clip(inner, -1.0, 1.0))
