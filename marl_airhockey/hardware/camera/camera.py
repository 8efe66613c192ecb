"""Thread that reads frames from a source and stores the newest."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import NamedTuple, Protocol, Self

from marl_airhockey.types import Array

TRANSIT_WEIGHT = 0.1
"""Weight of the newest frame in the mean time of transit."""
STALE = 0.1
"""Age of the newest frame beyond which frames are missing, s."""


class CameraError(RuntimeError):
    """Error of a camera that delivers no frames."""


class CameraFrame(NamedTuple):
    """Frame of a camera."""

    image: Array
    """Image (H, W, 3) uint8, blue, green, red."""
    taken: float
    """Time of the middle of the exposure, monotonic clock, s."""
    number: int
    """Number of the frame in the source, from 0 on; gaps are dropped frames."""
    arrived: float = float("nan")
    """Time at which a `Camera` received it, monotonic clock, s."""


class Source(Protocol):
    """Source of frames, read by one thread."""

    def open(self) -> None:
        """Start the source.

        Raises:
            CameraError: There is nothing to read. The message contains a remedy.
        """

    def read(self) -> CameraFrame | None:
        """Wait for the next frame and return it; None at the end."""

    def close(self) -> None:
        """Stop the source; a waiting `read` returns."""


class Camera:
    """Camera that stores the newest frame of a source, used in a ``with`` block.

    Args:
        source: Source of the frames.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._new = threading.Condition()
        self._frame: CameraFrame | None = None
        self._closing = False
        self._thread: threading.Thread | None = None
        self._error = ""
        self.transit = 0.0
        """Mean time from a frame's exposure until it arrived, s."""
        self.dropped = 0
        """Number of frames that `next` did not return before a newer one arrived."""
        self._taken = -1
        self.listeners: list[Callable[[CameraFrame], None]] = []
        """Functions that get every frame, in the reading thread; they must return
        immediately."""

    def __enter__(self) -> Self:
        try:
            self._source.open()
        except BaseException:
            self._source.close()
            raise
        self._closing = False
        self._thread = threading.Thread(target=self._read, name="camera", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._closing = True
        self._source.close()
        if self._thread is not None:
            self._thread.join(2.0)

    def _read(self) -> None:
        try:
            while not self._closing:
                frame = self._source.read()
                if frame is None:
                    break
                frame = frame._replace(arrived=time.monotonic())
                transit = frame.arrived - frame.taken
                weight = TRANSIT_WEIGHT if self._frame is not None else 1.0
                self.transit += weight * (transit - self.transit)
                for listen in tuple(self.listeners):
                    listen(frame)
                with self._new:
                    if self._frame is not None and self._frame.number != self._taken:
                        self.dropped += 1
                    self._frame = frame
                    self._new.notify_all()
        except (CameraError, OSError) as error:
            self._error = str(error)

    @property
    def newest(self) -> CameraFrame | None:
        """Newest frame, or None. It counts as dropped unless `next` returns it."""
        return self._frame

    @property
    def age(self) -> float:
        """Age of the newest frame, s; infinite before the first."""
        frame = self._frame
        return time.monotonic() - frame.taken if frame else float("inf")

    @property
    def trouble(self) -> str:
        """Reason why there are no new frames; "" without a problem."""
        if self._error:
            return f"camera: {self._error}"
        if self._frame is None:
            return "camera: no frame yet"
        if self.age > STALE:
            return f"camera: no frame for {self.age:.2f} s"
        return ""

    def next(self, after: int = -1, seconds: float = 1.0) -> CameraFrame | None:
        """Wait for a frame with a number above ``after`` and return the newest one.

        Return None if none arrives within ``seconds``.
        """
        with self._new:
            self._new.wait_for(
                lambda: self._frame is not None and self._frame.number > after, seconds
            )
            frame = self._frame
            if frame is None or frame.number <= after:
                return None
            self._taken = frame.number
            return frame
