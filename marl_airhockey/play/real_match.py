"""Real match: one on a real table, whose steps take as long as they last."""

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
"""Width of the camera's pictures as pages get them, px, and their JPEG quality"""
LIVE = 0.25
"""Longest time for which a page's video waits for the next picture, s"""
DRAWN = 60
"""Number of newest pictures whose median time until they are drawn is shown"""
PICTURE = 0.08
"""Shortest time between two of them, s"""
REST = 1.5
"""Time between two episodes that begin by themselves, s"""


class CountingOperator:
    """Operator who counts down, for all to see, before a puck is let go.

    Args:
        own: who does the work.
        match: whose phase shows the time that is left.
    """

    def __init__(self, own: Operator, match: RealMatch) -> None:
        self._match = match
        self.begin, self.place, self.allow = own.begin, own.place, own.allow
        self._release = own.release

    def release(self) -> None:
        """Count down, then let the puck go."""
        self._match.count_down()
        self._release()


class RealMatch(LiveMatch):
    """Match on a real table.

    `tick` runs in a thread of its own: it waits for the world's steps, for the arm to
    come home and for the people who put the puck on the table. A table cannot be
    paused: who asks for it ends the episode, and the paddle brakes.

    Args:
        scenario: its name.
        drivers: see `LiveMatch`.
        keywords: of the environment, the rig among them.
        handicap: see `LiveMatch`, without noise.
        seed: of the first episode.
    """

    CONTROL_DT = 0.05
    """Period of the policies for real arms, s"""

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
        """True to begin episodes without being asked, the first for who looks on."""
        self.watched = False
        """True while pages are connected."""
        self.drawn_after: deque[float] = deque(maxlen=DRAWN)
        """Times from the middle of an exposure until a page says that it has drawn the
        picture, s, of the newest pictures."""
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
        """Draw what an episode begins with; nothing moves before `start`."""
        self.world.draw_worlds(np.zeros(1, np.int64))
        self._begin_episode()

    def set_handicap(self, handicap: Handicap) -> None:
        if handicap.noise:
            raise ValueError("noise: a real arm is given none")
        super().set_handicap(handicap)

    def warm_up(self) -> None:
        """Do nothing: what is compiled is so before an episode begins."""

    def start(self) -> None:
        """Begin an episode, or answer what a person was asked."""
        if self.phase == "pause":
            self._answered.set()
        elif self.phase in ("lobby", "done"):
            self.phase, self.reason = "arrange", "the paddle goes to its place"

    def pause(self, reason: str = "") -> None:
        """End the episode: a puck on a real table does not wait."""
        self.abort(reason or "stopped")

    def abort(self, reason: str) -> None:
        """End the episode; the paddle brakes."""
        if self.phase in ("play", "countdown", "pause", "arrange"):
            self.backend.robot.disable()
            self.phase, self.reason = "done", reason
            # Nobody presses a button after a stop but to begin again.
            self.again = False

    def clear(self) -> None:
        """Forget the last episode; of one that runs, do no more than end it.

        Another thread may still wait for the arm or for people.
        """
        if self.phase == "done":
            super().clear()
        else:
            self.abort("the players changed")

    def ask(self, words: str) -> None:
        """Show words to the people at the pages; return when one of them agrees.

        Raises:
            RuntimeError: they broke it off.
        """
        self._answered.clear()
        self.phase, self.reason = "pause", words
        while not self._answered.wait(0.05):
            self._go_on()
        self.phase, self.reason = "arrange", ""

    def count_down(self) -> None:
        """Let `COUNTDOWN` pass.

        Raises:
            RuntimeError: it was broken off.
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
            raise RuntimeError(self.reason if self.phase == "done" else "it was closed")

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
        # Pages note pictures in another thread.
        times = list(self.drawn_after)
        drawn = round(1e3 * float(np.median(times)), 1) if times else None
        table = {**self.backend.telemetry(), "drawn_ms": drawn}
        return {**super().state(), "table": table}

    def describe(self) -> dict[str, Any]:
        low, high = self.backend.rectifier.extent
        video = {"low": low.tolist(), "high": high.tolist()}
        return {**super().describe(), "video": video}

    def live_picture(self, after: int) -> tuple[int, float, bytes] | None:
        """Return the next picture from above: its number, time taken, s, and a JPEG.

        None if none comes in time.

        Args:
            after: number of the last one.
        """
        frame = self.backend.camera.next(after, LIVE)
        if frame is None:
            return None
        flat = self.backend.rectifier.rectify(frame.image, WIDTH)
        quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
        done, packed = cv2.imencode(".jpg", flat, quality)
        return (frame.number, frame.taken, packed.tobytes()) if done else None

    def note_drawn(self, taken: float) -> None:
        """Note that a page has drawn the picture that was taken at a time, s."""
        self.drawn_after.append(time.monotonic() - taken)

    def picture(self) -> bytes:
        """Return the camera's newest picture, a JPEG with the estimate drawn over it.

        Raises:
            RuntimeError: there is none.
        """
        now = time.monotonic()
        if now - self._pictured > PICTURE:
            self._picture, self._pictured = self._encode(), now
        return self._picture

    def _encode(self) -> bytes:
        world = self.world
        state = world.state.map(lambda x: x[0])
        memory = {name: value[0] for name, value in world.memory.items()}
        marks = world.scenario.all_marks(state, memory)
        drawn: Array = self.backend.photograph(0, "table", marks, WIDTH)
        quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
        done, packed = cv2.imencode(".jpg", drawn[..., ::-1], quality)
        return packed.tobytes() if done else b""

    def close(self) -> None:
        self._closing.set()
        with self._busy:
            super().close()
