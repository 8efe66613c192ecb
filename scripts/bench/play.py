"""Measure the latency of the page from a pointer event to the image, in Chromium.

    python scripts/bench/play.py --seconds 20

There are three cases:

* one player against a policy;
* two players and watchers, which are connections that receive every frame like a page;
* one player, and connections that never finish their request and are opened again when
  the server closes them.

For each case the script prints the time from a pointer event to the image that shows
the server's answer, the frames of state per second, the rate of the server's loop and
its share of a core. Browser (headless), watchers and server share the cores of the
machine. Their load is also printed.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import os
import re
import resource
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import websockets
from playwright.sync_api import Browser, Page, sync_playwright
from rich.console import Console
from rich.table import Table

ARGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
POINTER_RATE = 60
"""Pointer events per second and player, at random times. Browser, server and pointer
run at nearly the same rate, so regular events would measure the differences of their
phases."""


def serve(*options: str) -> tuple[str, subprocess.Popen[str]]:
    """Start `airhockey play`; return its address and process."""
    command = [sys.executable, "-m", "marl_airhockey.cli", "play", "duel", *options]
    process = subprocess.Popen(
        [*command, "--port", "0", "--no-browser", "--option", "seconds=600"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    lines = (re.search(r"http://\S+", line) for line in process.stdout)
    return next(filter(None, lines))[0], process


def cpu(pid: int) -> float:
    """Return the CPU-seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Watchers:
    """Connections that receive every frame, in a separate thread."""

    def __init__(self, address: str, count: int) -> None:
        self._address = address.replace("http", "ws") + "ws"
        self._count, self._loop = count, asyncio.new_event_loop()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        self._loop.run_until_complete(self._all())

    async def _all(self) -> None:
        await asyncio.gather(*(self._one() for _ in range(self._count)))

    async def _one(self) -> None:
        async with websockets.connect(self._address) as connection:
            with contextlib.suppress(websockets.ConnectionClosed):
                while True:
                    data = json.loads(await connection.recv())
                    # A page does the same.
                    if data["t"] == "state" and data["f"] % 3 == 0:
                        await connection.send(json.dumps({"t": "seen", "f": data["f"]}))


class HalfOpen:
    """Connections that never finish their request, in a separate thread."""

    def __init__(self, address: str, count: int) -> None:
        host, port = address.removeprefix("http://").rstrip("/").split(":")
        self._where, self._count = (host, int(port)), count
        self.opened = 0
        """Number of connections that were opened."""
        if count:
            hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
            resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
            threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        own: list[socket.socket] = []
        while True:
            own = [each for each in own if not self._dropped(each)]
            with contextlib.suppress(OSError):
                while len(own) < self._count:
                    own.append(socket.create_connection(self._where, 1.0))
                    own[-1].sendall(b"GET / HTTP/1.1\r\nHost: 127")
                    own[-1].setblocking(False)
                    self.opened += 1
            time.sleep(0.2)

    def _dropped(self, each: socket.socket) -> bool:
        try:
            return not each.recv(1)
        except BlockingIOError:
            return False
        except OSError:
            return True


def seated(browser: Browser, address: str) -> Page:
    """Open a page that gets a seat."""
    size: Any = {"width": 1000, "height": 600}
    page = browser.new_page(viewport=size, bypass_csp=True)
    page.goto(address)
    page.wait_for_function("window.airhockey.frames.length > 9")
    return page


def measure(pages: list[Page], pid: int, seconds: float) -> list[str]:
    """Move the pointers of all pages for some seconds; return a row of the table."""
    boxes = []
    for page in pages:
        box = page.locator("#table").bounding_box()
        assert box is not None
        boxes.append(box)
        page.evaluate(
            "airhockey.frames.length = airhockey.numbers.length = "
            "airhockey.latencies.length = 0"
        )
    rates: list[float] = []
    rng = np.random.default_rng(0)
    began, used, events = time.perf_counter(), cpu(pid), 0
    while time.perf_counter() - began < seconds:
        angle = 3.0 * (time.perf_counter() - began)
        for page, box in zip(pages, boxes, strict=True):
            x = box["x"] + box["width"] * (0.25 + 0.08 * math.cos(angle))
            y = box["y"] + box["height"] * (0.5 + 0.15 * math.sin(angle))
            page.mouse.move(x, y)
        events += 1
        if events % POINTER_RATE == 0:
            rates.append(float(pages[0].evaluate("airhockey.state().rate")))
        due = began + (events + rng.random()) / POINTER_RATE
        time.sleep(max(0.0, due - time.perf_counter()))
    spent = time.perf_counter() - began
    used = cpu(pid) - used
    late: list[float] = []
    frames = 0
    for page in pages:
        late += page.evaluate("airhockey.latencies")
        frames += page.evaluate("airhockey.frames.length")
    p50, p99 = np.percentile(late, [50, 99])
    return [
        f"{p50:.1f}",
        f"{p99:.1f}",
        f"{len(late)}",
        f"{frames / spent / len(pages):.1f}",
        f"{np.mean(rates):.2f}",
        f"{used / spent:.1%}",
        f"{os.getloadavg()[0]:.1f}",
    ]


def main(
    seconds: Annotated[float, typer.Option(help="Duration of each case, s.")] = 20.0,
    watchers: Annotated[
        int, typer.Option(help="Number of watchers in the second case.")
    ] = 20,
    half_open: Annotated[
        int, typer.Option(help="Number of unfinished connections in the third case.")
    ] = 1050,
) -> None:
    """Measure and print."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise SystemExit("Chromium is not installed: apt-get install chromium")
    table = Table(
        "case", "p50 ms", "p99 ms", "events", "frames/s", "loop Hz", "server", "load"
    )
    person = ["--driver", "paddle_1=person"]
    cases: list[tuple[str, list[str], int, int, int]] = [
        ("1 player", [], 1, 0, 0),
        (f"2 players, {watchers} watchers", person, 2, watchers, 0),
        (f"1 player, {half_open} half-open connections", [], 1, 0, half_open),
    ]
    with sync_playwright() as playwright:
        for name, options, players, crowd, idle in cases:
            address, process = serve(*options)
            # Each player has a browser, because hidden pages are updated less often.
            browsers = [
                playwright.chromium.launch(executable_path=chromium, args=ARGS)
                for _ in range(players)
            ]
            try:
                pages = [seated(browser, address) for browser in browsers]
                Watchers(address, crowd)
                flood = HalfOpen(address, idle)
                pages[0].keyboard.press("Space")
                time.sleep(5.0)
                row = measure(pages, process.pid, seconds)
                table.add_row(f"{name} ({flood.opened})" if idle else name, *row)
            finally:
                for browser in browsers:
                    browser.close()
                process.kill()
                process.wait()
    Console().print(table)


if __name__ == "__main__":
    typer.run(main)
