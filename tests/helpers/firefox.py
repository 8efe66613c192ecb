"""Headless Firefox, driven by its own remote protocol (Marionette)."""

import contextlib
import json
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path

PROGRAM = shutil.which("firefox-esr") or shutil.which("firefox")


class Firefox:
    """Session of a headless Firefox with one page."""

    def __init__(self, port):
        self._socket, self._count = self._connected(port), 0
        self._receive()  # the greeting
        self.ask("WebDriver:NewSession", capabilities={})

    @staticmethod
    def _connected(port):
        until = time.monotonic() + 60.0
        while True:
            try:
                return socket.create_connection(("127.0.0.1", port), 60.0)
            except OSError:
                assert time.monotonic() < until, "Firefox does not answer"
                time.sleep(0.2)

    def _receive(self):
        size = b""
        while not size.endswith(b":"):
            size += self._socket.recv(1)
        wanted, data = int(size[:-1]), b""
        while len(data) < wanted:
            data += self._socket.recv(wanted - len(data))
        return json.loads(data)

    def ask(self, command, **parameters):
        """Send a command; return its result."""
        self._count += 1
        text = json.dumps([0, self._count, command, parameters]).encode()
        self._socket.sendall(str(len(text)).encode() + b":" + text)
        *_, error, result = self._receive()
        assert error is None, error
        return result

    def close(self):
        """Close the connection."""
        self._socket.close()

    def open(self, address):
        """Open an address."""
        self.ask("WebDriver:Navigate", url=address)

    def run(self, expression):
        """Return the value of an expression in the page."""
        script = {"script": f"return {expression};", "args": []}
        return self.ask("WebDriver:ExecuteScript", **script)["value"]

    def wait(self, expression, seconds=30.0):
        """Wait until an expression is true."""
        until = time.monotonic() + seconds
        while not self.run(expression):
            assert time.monotonic() < until, expression
            time.sleep(0.1)

    def point(self, x, y):
        """Move the mouse to a point of the window, px."""
        move = {"type": "pointerMove", "duration": 0, "x": round(x), "y": round(y)}
        mouse = {"type": "pointer", "id": "mouse", "actions": [move]}
        self.ask("WebDriver:PerformActions", actions=[mouse])


@contextlib.contextmanager
def firefox():
    """A session of a new profile."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as profile:
        Path(profile, "user.js").write_text(
            f'user_pref("marionette.port", {port});\n'
            'user_pref("datareporting.policy.dataSubmissionEnabled", false);\n'
            'user_pref("app.update.enabled", false);\n'
        )
        command = [PROGRAM, "--headless", "--marionette", "--profile", profile]
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            with contextlib.closing(Firefox(port)) as page:
                yield page
        finally:
            process.terminate()
            process.wait(20)
