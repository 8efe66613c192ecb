"""Limits on the connections of a server before their request is complete."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from typing import Any, ClassVar

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from marl_airhockey.play.access import SecurityHeaders
from marl_airhockey.play.protocol import LARGEST

WAITING, WAITING_OF_ONE = 128, 32
"""Largest number of connections without a request, in total and per address. New
connections replace the oldest ones."""
HEADER_TIME = 5.0
"""Longest time until a request is complete, s."""
BACKLOG = 64
"""Largest number of connections that wait to be accepted."""
LINES, PERIOD = 3, 10.0
"""Largest number of lines of a log in a period, and the period, s."""


class LimitedProtocol(H11Protocol):
    """Protocol of a connection with one request and a time limit.

    A connection without a complete request is dropped after `HEADER_TIME`, or when
    there are too many newer ones. A connection with a complete request is never
    dropped.
    """

    waiting: ClassVar[list[LimitedProtocol]] = []
    """Connections without a request, sorted by age with the oldest first."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._limit = self.loop.call_later(HEADER_TIME, self._drop)
        self.waiting.append(self)
        address = self.client[0] if self.client else ""
        own = [p for p in self.waiting if p.client and p.client[0] == address]
        if len(own) > WAITING_OF_ONE:
            own[0]._drop()
        if len(self.waiting) > WAITING:
            self.waiting[0]._drop()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.scope is not None:
            self._stop_waiting()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_waiting()
        super().connection_lost(exc)

    def _drop(self) -> None:
        self._stop_waiting()
        self.transport.abort()

    def _stop_waiting(self) -> None:
        self._limit.cancel()
        if self in self.waiting:
            self.waiting.remove(self)


class RareLines(logging.Filter):
    """Filter that passes `LINES` lines per `PERIOD`, without tracebacks."""

    def __init__(self) -> None:
        super().__init__()
        self._times: list[float] = []

    def filter(self, record: logging.LogRecord) -> bool:
        """Return True for a record that is written; reduce it to one line."""
        now = time.monotonic()
        self._times = [t for t in self._times if now - t < PERIOD]
        if len(self._times) == LINES:
            return False
        self._times.append(now)
        error = record.exc_info[1] if record.exc_info else None
        first = record.getMessage().partition("\n")[0]
        record.msg = f"{first}: {error}" if error else first
        record.args, record.exc_info, record.exc_text = (), None, None
        return True


def listen(host: str, port: int) -> socket.socket:
    """Return a listening TCP socket.

    Raises:
        ValueError: The address is in use, or does not belong to this machine.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With an explicit protocol, asyncio sets TCP_NODELAY. Otherwise Nagle's algorithm
    # would delay each frame until the page has acknowledged the last one.
    server = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        server.bind((host, port))
        # Connections that arrive before the server runs wait for it.
        server.listen(BACKLOG)
    except OSError as error:
        server.close()
        raise ValueError(f"--host {host} --port {port}: {error.strerror}") from error
    return server


def serve(app: ASGIApp, server: socket.socket) -> None:
    """Serve an application at a listening socket until interrupted.

    All responses have the security headers of `access.HEADERS`.
    """
    settings: dict[str, Any] = {
        "log_level": "error",
        "lifespan": "on",
        "http": LimitedProtocol,
        "backlog": BACKLOG,
        "ws_max_size": 4 * LARGEST,
        "ws_per_message_deflate": False,
        "ws_ping_interval": 10.0,
        "ws_ping_timeout": 20.0,
        "timeout_graceful_shutdown": 1,
    }
    config = uvicorn.Config(SecurityHeaders(app), **settings)
    for name in ("asyncio", "uvicorn.error"):
        logging.getLogger(name).addFilter(RareLines())
    with contextlib.suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[server])
