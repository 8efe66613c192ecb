"""Measure the page without a server: its size, first frame, frames and CPU time.

    python scripts/bench/static_page.py PAGE

PAGE is a folder that `airhockey play --static PAGE` has written. The script opens it in
headless Chromium, plays duel with the mouse, and writes docs/data/static_page.json.
The share of a core is that of the page's main thread. Chromium draws the canvas with
the processor, as the machine has no graphics card.
"""

from __future__ import annotations

import json
import shutil
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from playwright.sync_api import CDPSession, Page, sync_playwright

DATA = Path(__file__).parents[2] / "docs/data/static_page.json"
ARGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
COUNT = """() => {
    window.drawn = [];
    const count = (at) => { window.drawn.push(at); requestAnimationFrame(count); };
    requestAnimationFrame(count);
}"""


class Quiet(SimpleHTTPRequestHandler):
    """Web server of a folder, without a log."""

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def busy(session: CDPSession) -> float:
    """Return the time for which the main thread of a page was busy, s."""
    rows = session.send("Performance.getMetrics")["metrics"]
    return float(next(row["value"] for row in rows if row["name"] == "TaskDuration"))


def played(page: Page, session: CDPSession, seconds: float) -> dict[str, float]:
    """Play for some seconds; return the rates of the page."""
    page.keyboard.press("Space")
    page.wait_for_function("airhockey.state().phase === 'play'")
    page.evaluate(COUNT)
    first, frames = busy(session), page.evaluate("airhockey.state().f")
    began, rng = time.perf_counter(), np.random.default_rng(0)
    while (spent := time.perf_counter() - began) < seconds:
        page.mouse.move(*rng.uniform((150, 200), (500, 500)))
        time.sleep(rng.exponential(1 / 60))
    gaps = np.diff(page.evaluate("window.drawn"))
    return {
        "frames_per_s": round(1e3 / float(gaps.mean()), 1),
        "longest_frame_ms": round(float(np.percentile(gaps, 99)), 1),
        "ticks_per_s": round(
            (page.evaluate("airhockey.state().f") - frames) / spent, 1
        ),
        "core_share": round((busy(session) - first) / spent, 3),
    }


def main(
    page: Annotated[Path, typer.Argument(help="Folder of the page.", exists=True)],
    seconds: Annotated[float, typer.Option(help="Time of play, s.")] = 20.0,
) -> None:
    """Measure a page without a server."""
    sizes = [file.stat().st_size for file in page.rglob("*") if file.is_file()]
    code = (page / "games" / "code.bin").stat().st_size
    found: dict[str, Any] = {
        "files": len(sizes),
        "mb": round(sum(sizes) / 1e6, 2),
        "code_kb": round(code / 1e3),
    }
    handler = partial(Quiet, directory=str(page))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=ARGS)
        tab = browser.new_page(viewport={"width": 1280, "height": 720})
        session = tab.context.new_cdp_session(tab)
        session.send("Performance.enable")
        tab.goto(f"http://127.0.0.1:{server.server_port}")
        tab.wait_for_function("window.airhockey && airhockey.frames.length > 0")
        found["first_frame_s"] = round(tab.evaluate("airhockey.frames[0]") / 1e3, 2)
        loaded = "performance.getEntriesByType('resource').map((e) => e.transferSize)"
        found["loaded_mb"] = round(sum(tab.evaluate(loaded)) / 1e6, 2)
        found |= played(tab, session, seconds)
        browser.close()
    server.shutdown()
    DATA.write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    typer.run(main)
