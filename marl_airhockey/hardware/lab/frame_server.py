"""Server of a simulated camera's frames, for `StreamSource`."""

from __future__ import annotations

import socket
import threading
import time
from queue import SimpleQueue

from marl_airhockey.hardware.camera.camera import CameraFrame
from marl_airhockey.hardware.camera.sources import pack_frame


class FrameServer:
    """Server of a stream of frames.

    Each client gets the newest frame, and every frame at most once. The server listens
    only on the loopback address.

    Args:
        latency: Time from when a frame is taken until it is sent to clients, s.
    """

    def __init__(self, latency: float) -> None:
        self.latency = latency
        self._waiting: SimpleQueue[CameraFrame] = SimpleQueue()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._new = threading.Condition()
        self._packed, self._count, self._clients = b"", 0, 0
        for work in (self._accept, self._pass_on):
            threading.Thread(target=work, daemon=True).start()

    @property
    def watched(self) -> bool:
        """True while there are clients."""
        return self._clients > 0

    def send(self, frame: CameraFrame) -> None:
        """Send a frame to all clients when it is due."""
        self._waiting.put(frame)

    def _pass_on(self) -> None:
        while True:
            frame = self._waiting.get()
            packed = pack_frame(frame)
            time.sleep(max(frame.taken + self.latency - time.monotonic(), 0.0))
            with self._new:
                self._packed, self._count = packed, self._count + 1
                self._new.notify_all()

    def _accept(self) -> None:
        while True:
            client, _ = self._listener.accept()
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        seen = 0
        with self._new:
            self._clients += 1
        with client:
            while True:
                with self._new:
                    self._new.wait_for(lambda: self._count > seen)  # noqa: B023
                    packed, seen = self._packed, self._count
                try:
                    client.sendall(packed)
                except OSError:
                    break
        with self._new:
            self._clients -= 1
