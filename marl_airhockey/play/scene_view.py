"""3D scene of a match with arms, rendered next to the loop of ticks."""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
import time
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.scene_process import run_renderer
from marl_airhockey.sim.backends.robosuite.backend import RobosuiteBackend

RATE = 15
"""Largest number of images per second."""
LIVE = 0.25
"""Longest time for which a page waits for the next image, s."""
WATCHED = 1.0
"""Time since the last request of a page after which nothing is rendered, s."""
ENDING = 2.0
"""Longest time for which `SceneView.close` waits for the process, s."""


class SceneView:
    """Images of the arms and the table of a running match.

    A separate process renders, so that the loop of ticks only sends joint positions. If
    it fails, the match continues without images.

    Args:
        match: Match whose backend is robosuite, see `SceneView.shows`.

    Raises:
        ValueError: The match has no arms.
    """

    @staticmethod
    def shows(match: LiveMatch) -> bool:
        """Return True if a match has a 3D scene."""
        return isinstance(match.world.backend, RobosuiteBackend)

    def __init__(self, match: LiveMatch) -> None:
        self._changed = threading.Condition()
        self._failure, self._closing = "", False
        self._number, self._image = -1, b""
        self._shown: tuple[Any, ...] = ()
        """Content of the newest request."""
        self._idle = True
        """True if the process has answered all requests."""
        self._due, self._watched = 0.0, 0.0
        context = multiprocessing.get_context("spawn")
        self._pipe, end = context.Pipe()
        backend = _backend(match)
        arguments = backend.env.sim.model._model, backend.env.frame, end
        self.process = context.Process(target=run_renderer, args=arguments, daemon=True)
        """Process that renders."""
        self._thread = threading.Thread(target=self._receive, args=(end,), daemon=True)
        self._thread.start()

    @property
    def failure(self) -> str:
        """Reason why there are no more images; "" if there are."""
        return self._failure

    def offer(self, match: LiveMatch) -> None:
        """Send the state of a match to the process if an image is due.

        The loop of ticks calls this at every tick. Nothing is sent while no page
        watches, the process is busy, or nothing moves.
        """
        now = time.monotonic()
        watched = now - self._watched < WATCHED
        if not (watched and self._idle) or now < self._due or self._failure:
            return
        self._due = max(self._due, now - 1 / RATE) + 1 / RATE
        world = match.world
        state = world.state.map(lambda x: x[0])
        memory = {name: value[0] for name, value in world.memory.items()}
        marks = world.scenario.shown_marks(state, memory)
        qpos = _backend(match).worlds[0].data.qpos
        request = tuple(qpos), [(mark.kind, mark.numbers) for mark in marks]
        if request == self._shown:
            return
        self._shown, self._idle = request, False
        with contextlib.suppress(OSError):  # `_receive` reports the end of the process.
            self._pipe.send((np.array(qpos), marks))

    def newest(self, after: int) -> tuple[int, bytes] | None:
        """Return the newest image: its number and a JPEG; None if there is no new one.

        Waits up to `LIVE` and is called in a separate thread.

        Args:
            after: Number of the last image, -1 for none.
        """
        self._watched = time.monotonic()
        with self._changed:
            fresh = self._changed.wait_for(
                lambda: self._number > after and not self._failure, LIVE
            )
            return (self._number, self._image) if fresh else None

    def _receive(self, end: Connection) -> None:
        """Start the process, and store what it sends until it ends."""
        try:
            self.process.start()
            end.close()
            while isinstance(answer := self._pipe.recv(), bytes):
                with self._changed:
                    self._number, self._image = self._number + 1, answer
                    self._idle = True
                    self._changed.notify_all()
        except (EOFError, OSError):
            answer = "its process has ended"
        if not self._closing:
            self._failure = f"3D scene: {answer}"

    def close(self) -> None:
        """End the process."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._pipe.send(None)
        self._thread.join(ENDING)
        if self.process.is_alive():
            self.process.kill()
        self._pipe.close()


def _backend(match: LiveMatch) -> RobosuiteBackend:
    backend = match.world.backend
    if not isinstance(backend, RobosuiteBackend):
        raise ValueError("the 3D scene needs the backend robosuite")
    return backend
