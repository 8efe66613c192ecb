"""RPC server on a loopback port for requests of other processes.

A request is a line of JSON, {"do": NAME, ...}, and so is the response. The response to
a rejected request is {"error": REASON}.
"""

from __future__ import annotations

import json
import os
import socket
import socketserver
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

Answer = Callable[[dict[str, Any]], dict[str, Any]]
"""Function that returns the response to a request."""
WAIT = 10.0
"""Longest time until a response, s."""


@contextmanager
def open_door(answer: Answer, file: Path | None = None) -> Iterator[int]:
    """Start an RPC server and yield its port.

    Args:
        answer: Function that returns the response to a request. It is called in the
            threads of the clients. Its ValueError, RuntimeError, KeyError or TypeError
            becomes the error in the response.
        file: File in which other commands find the port; None for no file.
    """

    class Visit(socketserver.StreamRequestHandler):
        """Handler of a client."""

        def handle(self) -> None:
            for line in self.rfile:
                try:
                    found = answer(json.loads(line))
                except (ValueError, RuntimeError, KeyError, TypeError) as error:
                    found = {"error": str(error)}
                self.wfile.write(json.dumps(found).encode() + b"\n")

    class Server(socketserver.ThreadingTCPServer):
        """TCP server with one thread per client."""

        daemon_threads, allow_reuse_address = True, True

    with Server(("127.0.0.1", 0), Visit) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = int(server.server_address[1])
        try:
            if file is not None:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(json.dumps({"pid": os.getpid(), "port": port}))
            yield port
        finally:
            server.shutdown()
            if file is not None:
                file.unlink(missing_ok=True)


class DoorClient:
    """Client of an RPC server, also for several threads.

    Args:
        port: Port of the server.
        name: Name of the service, for messages.

    Raises:
        OSError: No service listens at the port.
    """

    def __init__(self, port: int, name: str) -> None:
        self.port, self._name = port, name
        self._socket = socket.create_connection(("127.0.0.1", port), 2.0)
        self._socket.settimeout(WAIT)
        self._file = self._socket.makefile("rwb")
        self._lock = threading.Lock()

    def ask(self, do: str, **order: Any) -> dict[str, Any]:
        """Send a request and return the response.

        Raises:
            RuntimeError: The service rejects the request or has ended.
        """
        with self._lock:
            self._file.write(json.dumps({"do": do, **order}).encode() + b"\n")
            self._file.flush()
            line = self._file.readline()
        answer = json.loads(line) if line else {"error": "the service has ended"}
        if "error" in answer:
            raise RuntimeError(f"{self._name}: {answer['error']}")
        return dict(answer)

    def close(self) -> None:
        """Close the connection."""
        self._file.close()
        self._socket.close()


def port_in(file: Path) -> int | None:
    """Return the port in the file of a server; None if there is none."""
    try:
        return int(json.loads(file.read_text())["port"])
    except (OSError, ValueError, KeyError):
        return None
