"""Match on a real table, in real time."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any

import cv2
import numpy as np

from marl_airhockey.hardware.table.backend import RealBackend
from marl_airhockey.hardware.table.operator import Operator, make_operator
from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.live_match import COUNTDOWN, LiveMatch
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

WIDTH, QUALITY = 640, 80
"""Width of the camera images that pages receive, px, and their JPEG quality."""
LIVE = 0.25
"""Longest time for which the video of a page waits for the next frame, s."""
DRAWN = 60
"""Number of newest frames whose median display latency is shown."""
PICTURE = 0.08
"""Shortest time between two images with the estimate, s."""
REST = 1.5
"""Time between two episodes that start automatically, s."""


class CountingOperator:
    """Operator with a countdown on the page before the release of a puck.

    Args:
        own: Operator that places and releases the puck.
        match: Match whose phase shows the countdown.
    """

    def __init__(self, own: Operator, match: RealMatch) -> None:
        self._match = match
        self.begin, self.place, self.allow = own.begin, own.place, own.allow
        self._release = own.release

    def release(self) -> None:
        """Count down, then release the puck."""
        self._match.count_down()
        self._release()


class RealMatch(LiveMatch):
    """Match on a real table.

    `tick` runs in a separate thread. It waits for the steps of the world, for the arm
    to move to its start position, and for the people who place the puck. A real table
    cannot be paused: `pause` ends the episode, and the paddle brakes.

    Args:
        scenario: Name of the scenario.
        drivers: Drivers by agent, see `LiveMatch`.
        keywords: Keywords of the environment, with the rig.
        handicap: Limits of the speed, see `LiveMatch`.
        seed: Seed of the first episode.
    """

    CONTROL_DT = 0.05
    """Default time between two actions, s: that of the policies for real arms."""

    def __init__(
        self,
        scenario: str,
        drivers: dict[str, str],
        keywords: Keywords,
        handicap: Handicap | None = None,
        seed: int | None = None,
    ) -> None:
        self._answered, self._closing = threading.Event(), threading.Event()
        self._busy = threading.Lock()
        self._picture, self._pictured = b"", 0.0
        self._ended = 0.0
        self.again = False
        """True to start episodes automatically while a page is connected."""
        self.watched = False
        """True while pages are connected."""
        self.drawn_after: deque[float] = deque(maxlen=DRAWN)
        """Display latencies of the newest frames, s: from the middle of the exposure
        until a page reports that the frame is displayed."""
        super().__init__(scenario, drivers, keywords, handicap, seed)
        own = make_operator(self.backend.rig.operator, self.ask)
        self.backend.placing.operator = CountingOperator(own, self)

    @property
    def backend(self) -> RealBackend:
        """Backend of the table."""
        backend = self.world.backend
        assert isinstance(backend, RealBackend)
        return backend

    def _next_episode(self) -> None:
        """Sample the start of an episode; nothing moves before `start`."""
        self.world.draw_worlds(np.zeros(1, np.int64))
        self._begin_episode()

    def set_driver(self, i: int, name: str, handicap: Handicap | None = None) -> None:
        if (handicap or self.handicap).observes:
            raise ValueError("reaction and noise must be 0 on a real table")
        super().set_driver(i, name, handicap)

    def warm_up(self) -> None:
        """Do nothing: everything is compiled before an episode starts."""

    def start(self) -> None:
        """Start an episode, or confirm a question to a person."""
        if self.phase == "pause":
            self._answered.set()
        elif self.phase in ("lobby", "done"):
            self.phase, self.reason = (
                "arrange",
                "the paddle moves to its start position",
            )

    def pause(self, reason: str = "") -> None:
        """End the episode, because a puck on a real table cannot be paused."""
        self.abort(reason or "stopped")

    def abort(self, reason: str) -> None:
        """End the episode; the paddle brakes."""
        if self.phase in ("play", "countdown", "pause", "arrange"):
            self.backend.robot.disable()
            self.phase, self.reason = "done", reason
            # After a stop, an episode starts only by a button.
            self.again = False

    def clear(self) -> None:
        """Return to the lobby after an episode; a running episode is only ended.

        Another thread may still wait for the arm or for people.
        """
        if self.phase == "done":
            super().clear()
        else:
            self.abort("the players changed")

    def ask(self, words: str) -> None:
        """Show a text on the pages; return when a person confirms it.

        Raises:
            RuntimeError: A person ended the episode, or the match was closed.
        """
        self._answered.clear()
        self.phase, self.reason = "pause", words
        while not self._answered.wait(0.05):
            self._go_on()
        self.phase, self.reason = "arrange", ""

    def count_down(self) -> None:
        """Show the countdown and wait until it ends.

        Raises:
            RuntimeError: A person ended the episode, or the match was closed.
        """
        until = time.monotonic() + COUNTDOWN
        self.phase, self.reason = "countdown", ""
        while (left := until - time.monotonic()) > 0:
            self.time_left = left
            time.sleep(0.02)
            self._go_on()
        self.phase, self.time_left = "arrange", 0.0

    def _go_on(self) -> None:
        if self._closing.is_set() or self.phase == "done":
            raise RuntimeError(
                self.reason if self.phase == "done" else "the match was closed"
            )

    def tick(self) -> bool:
        with self._busy:
            self.events = []
            if self._closing.is_set():
                return False
            if self.phase == "arrange":
                self._arrange()
            elif self.phase in ("lobby", "done") and self.again:
                if not self.watched:
                    self._ended = time.monotonic()
                elif time.monotonic() - self._ended > REST:
                    self.start()
            elif self.phase == "play":
                self._step()
                return True
            return False

    def _arrange(self) -> None:
        try:
            self.world.reset()
        except RuntimeError as error:
            self.phase, self.reason = "done", str(error)
            self.again = False
            return
        self._begin_episode()
        if self.phase == "arrange":
            self.phase, self.reason = "play", ""

    def _step(self) -> None:
        super()._step()
        if self.phase == "done":
            self._ended = time.monotonic()
            assert self.result is not None
            self.reason = self.result.interruption

    def state(self) -> dict[str, Any]:
        # Pages report drawn frames in another thread.
        times = list(self.drawn_after)
        drawn = round(1e3 * float(np.median(times)), 1) if times else None
        table = {**self.backend.telemetry(), "drawn_ms": drawn}
        return {**super().state(), "table": table}

    def describe(self) -> dict[str, Any]:
        low, high = self.backend.rectifier.extent
        video = {"low": low.tolist(), "high": high.tolist()}
        return {**super().describe(), "video": video}

    def live_picture(self, after: int) -> tuple[int, float, bytes] | None:
        """Return the next frame from above: its number, exposure time, s, and a JPEG.

        Returns None if no frame arrives in time.

        Args:
            after: Number of the last frame.
        """
        frame = self.backend.camera.next(after, LIVE)
        if frame is None:
            return None
        flat = self.backend.rectifier.rectify(frame.image, WIDTH)
        quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
        done, packed = cv2.imencode(".jpg", flat, quality)
        return (frame.number, frame.taken, packed.tobytes()) if done else None

    def note_drawn(self, taken: float) -> None:
        """Store that a page has drawn the frame that was exposed at a time, s."""
        self.drawn_after.append(time.monotonic() - taken)

    def picture(self) -> bytes:
        """Return a JPEG of the newest camera frame with the estimated state.

        Raises:
            RuntimeError: There is no frame.
        """
        now = time.monotonic()
        if now - self._pictured > PICTURE:
            self._picture, self._pictured = self._encode(), now
        return self._picture

    def _encode(self) -> bytes:
        world = self.world
        state = world.state.map(lambda x: x[0])
        memory = {name: value[0] for name, value in world.memory.items()}
        marks = world.scenario.shown_marks(state, memory)
        drawn: Array = self.backend.photograph(0, "table", marks, WIDTH)
        quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
        done, packed = cv2.imencode(".jpg", drawn[..., ::-1], quality)
        return packed.tobytes() if done else b""

    def close(self) -> None:
        self._closing.set()
        with self._busy:
            super().close()
