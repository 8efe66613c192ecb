"""Link to a page, whose frame rate depends on the acknowledgements of the page."""

from __future__ import annotations

from collections import deque

from marl_airhockey.play.live_match import RATE

STRIDES = (1, 2, 6)
"""Number of ticks between two frames, by level: 60, 30 or 10 frames/s."""
QUEUED = 0.1
"""Delay in excess of the shortest delay that indicates a queue of frames, s."""
BATCH = 0.05
"""Time for which a page may collect acknowledgements, s."""
FORGOTTEN = 1.0
"""Time after which a frame without an acknowledgement no longer counts as sent, s."""
WINDOW = 30.0
"""Time window for the shortest delay, s."""
FIRST_TRY, NEXT_TRY, LAST_TRY = 0.25, 2.0, 60.0
"""Times without a delayed frame until a higher rate is tried, s: at the start, after a
failure, and the largest time."""
STEADY = 30.0
"""Time without a delayed frame after which failures are forgotten, s."""


class Link:
    """Rate control of the frames to a page; only the newest frame is sent.

    The rate starts at the lowest level. It increases while acknowledgements arrive
    without delay. A page that acknowledges nothing receives a few frames per second.

    Args:
        now: Monotonic time, s.
    """

    def __init__(self, now: float) -> None:
        self._level = len(STRIDES) - 1
        self._since, self._patience = now, FIRST_TRY
        self._last = -STRIDES[-1]
        self._flying: deque[tuple[int, float]] = deque()
        """Number and time of the frames that are not acknowledged."""
        self._delays: deque[tuple[float, float]] = deque()
        """Time and delay of acknowledgements without a later shorter delay."""
        self._arrivals: deque[float] = deque()
        """Times of acknowledgements in the last second."""
        self._was_late = False
        self.delay = 0.0
        """Time from the last acknowledged frame to its acknowledgement, s."""

    @property
    def rate(self) -> int:
        """Frame rate, frames/s."""
        return RATE // STRIDES[self._level]

    @property
    def _shortest(self) -> float:
        return self._delays[0][1] if self._delays else 0.0

    def is_due(self, number: int, now: float) -> bool:
        """Return True if a frame may be sent.

        The number of frames without an acknowledgement is limited to twice the number
        that the link transmits in one round trip. This limits the queue before its
        delay is measured.

        Args:
            number: Number of the frame, which counts ticks.
            now: Monotonic time, s.
        """
        while self._flying and now - self._flying[0][1] > FORGOTTEN + self._shortest:
            self._flying.popleft()
        while self._arrivals and now - self._arrivals[0] > 1.0:
            self._arrivals.popleft()
        taken = len(self._arrivals) * (self._shortest + BATCH)
        due = number - self._last >= STRIDES[self._level]
        return due and len(self._flying) < 2.0 * taken + 2.0

    def note_sent(self, number: int, now: float) -> None:
        """Store that a frame was sent."""
        self._last = number
        self._flying.append((number, now))

    def acknowledge(self, number: int, now: float) -> None:
        """Process the acknowledgement of a frame and all previous ones."""
        sent = None
        while self._flying and self._flying[0][0] <= number:
            sent = self._flying.popleft()
            self._arrivals.append(now)
        if sent is None:
            return
        self.delay = now - sent[1]
        while self._delays and self._delays[-1][1] >= self.delay:
            self._delays.pop()
        self._delays.append((now, self.delay))
        while now - self._delays[0][0] > WINDOW:
            self._delays.popleft()
        late = self.delay > self._shortest + QUEUED
        # A page may pause briefly, so a single delayed answer has no effect.
        if late and self._was_late and self._level < len(STRIDES) - 1:
            self._level += 1
            self._patience = min(max(2 * self._patience, NEXT_TRY), LAST_TRY)
        elif not late and self._level and now - self._since > self._patience:
            self._level -= 1
            self._since = now
        if late:
            self._since = now
        elif now - self._since > STEADY:
            self._patience = FIRST_TRY
        self._was_late = late
