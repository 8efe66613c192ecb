"""Thread that searches every frame of a camera for a disc."""

from __future__ import annotations

import threading
import time
from collections import deque

import numpy as np

from marl_airhockey.hardware.camera import Camera
from marl_airhockey.hardware.vision.detector import Detector, Sighting
from marl_airhockey.types import Array

STUCK = 0.3
"""Time without a new frame after which a camera is stuck, s."""
RECENT, REPEATS = 20, 5
"""Number of recent frames, and least number of repeats among them that is a fault."""
KEPT = 256
"""Largest number of sightings that are stored until `Watcher.take`."""


class Watcher:
    """Watcher of a puck, or of a paddle.

    Args:
        camera: Open camera.
        detector: Detector of the disc.
    """

    def __init__(self, camera: Camera, detector: Detector) -> None:
        self._camera, self._detector = camera, detector
        self._found: deque[Sighting] = deque(maxlen=KEPT)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watcher", daemon=True)
        self.last: Sighting | None = None
        """Newest sighting; None before the first."""
        self.looked_at = float("nan")
        """Time at which the newest searched frame was taken, s."""
        self.arrived_at = float("nan")
        """Time at which that frame arrived, s."""
        self.seconds = 0.0
        """CPU time of the detector so far, s."""
        self.pictures = 0
        """Number of frames that were searched."""
        self._image = np.zeros((0, 0, 3), np.uint8)
        self._changed_at = time.monotonic()
        self._repeats: deque[bool] = deque(maxlen=RECENT)
        self._thread.start()

    @property
    def trouble(self) -> str:
        """Reason why the camera's frames contain nothing new; "" if they do."""
        recent = [*self._repeats]
        same = time.monotonic() - self._changed_at
        if not any(recent):
            return ""
        if all(recent[-REPEATS:]):
            return f"camera: the same frame for {same:.1f} s" if same > STUCK else ""
        if sum(recent) >= REPEATS:
            return (
                f"camera: {sum(recent)} of {len(recent)} frames repeat the one before"
            )
        return ""

    def _is_repeated(self, image: Array) -> bool:
        """Return True if a frame equals the previous one; real frames have noise."""
        same = np.array_equal(image, self._image)
        self._image = image
        self._repeats.append(same)
        if not same:
            self._changed_at = time.monotonic()
        return same

    def _watch(self) -> None:
        number = -1
        while not self._ended.is_set():
            frame = self._camera.next(number, 0.2)
            if frame is None:
                continue
            number, began = frame.number, time.thread_time()
            # With a repeated frame, the puck would seem to have stopped.
            repeated = self._is_repeated(frame.image)
            seen = None if repeated else self._detector.find(frame)
            self.seconds += time.thread_time() - began
            self.pictures += 1
            self.looked_at, self.arrived_at = frame.taken, frame.arrived
            if seen is not None:
                self.last = seen
                self._found.append(seen)

    def take(self) -> list[Sighting]:
        """Return the sightings since the last call, oldest first."""
        seen = []
        while self._found:
            seen.append(self._found.popleft())
        return seen

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self._thread.join(1.0)
