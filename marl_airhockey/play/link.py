"""Link to a page: how many frames a second it takes, by its acknowledgements."""

from __future__ import annotations

from collections import deque

from marl_airhockey.play.live_match import RATE

STRIDES = (1, 2, 6)
"""Ticks between two frames, by level: 60, 30 or 10 frames a second"""
QUEUED = 0.1
"""Delay beyond the shortest one from which frames wait on their way, s"""
BATCH = 0.05
"""Time for which a page may collect acknowledgements, s"""
FORGOTTEN = 1.0
"""Age from which a frame counts as answered: a page may acknowledge nothing, s"""
WINDOW = 30.0
"""Time over which the shortest delay is taken, s"""
FIRST_TRY, NEXT_TRY, LAST_TRY = 0.25, 2.0, 60.0
"""Times without a late frame until more are tried: at first, after a failure, and at
most, s"""
STEADY = 30.0
"""Time without a late frame after which failures are forgotten, s"""


class Link:
    """Pace of the frames to a page; only the newest frame is ever sent.

    It begins with the fewest frames and tries more while answers come without delay.
    A page that acknowledges nothing gets a few frames a second.

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
        """Time and delay of acknowledgements after which no shorter delay came."""
        self._arrivals: deque[float] = deque()
        """Times at which frames were acknowledged, of the last second."""
        self._was_late = False
        self.delay = 0.0
        """Time from the last acknowledged frame to its acknowledgement, s."""

    @property
    def rate(self) -> int:
        """Frames a second."""
        return RATE // STRIDES[self._level]

    @property
    def _shortest(self) -> float:
        return self._delays[0][1] if self._delays else 0.0

    def is_due(self, number: int, now: float) -> bool:
        """Return whether a frame may be sent.

        No more are on their way than twice those that the link has taken in a round
        trip, so that no queue forms before its delay is seen.

        Args:
            number: Number of the frame, one a tick.
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
        """Note that a frame is on its way."""
        self._last = number
        self._flying.append((number, now))

    def acknowledge(self, number: int, now: float) -> None:
        """Take the word of a page that a frame, and all before it, have come."""
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
        # A page may pause for a moment: one late answer alone changes nothing.
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
