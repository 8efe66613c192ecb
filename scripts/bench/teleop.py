"""Measure the latency of teleoperation in the virtual lab, by mouse and by shadow.

    python scripts/bench/teleop.py --seconds 20

By mouse, `airhockey teleop` runs in headless Chromium, with the button held and the
paddle guided. The script prints the time from the middle of a frame's exposure until
the page has drawn it, and the part of the lab's camera (exposure, readout, transfer).

By shadow, a hand moves under its camera and guides the arm. The script prints the time
by which the arm is behind the hand, and the remaining error of the position. Browser,
lab, arm and camera share the cores of the machine, whose load is printed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from typing import Annotated

import numpy as np
import typer
from playwright.sync_api import Page, sync_playwright
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.hardware.calibration.delay import find_delay
from marl_airhockey.hardware.calibration.lab_rig import hand_rig, lab_rig, running_lab
from marl_airhockey.hardware.lab.hand_camera import FIELD
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.types import Array

ARGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
HAND = {"middle": [0.0, 0.0], "amplitude": [0.08, 0.12], "period": 3.0}
CONTROL_DT = 0.05
"""Time between two actions, s."""
CAUGHT = 4.0
"""Time after which the hand guides the arm, s. By then it has passed the arm's
paddle."""


def lead(page: Page, seconds: float) -> list[float]:
    """Guide the paddle to and fro; return the latencies of the page's video, ms."""
    page.locator("button.main:visible").click()
    box = page.locator("#table").bounding_box()
    assert box is not None
    page.mouse.down()
    told: list[float] = []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        state = page.evaluate("airhockey.state()")
        if state["phase"] in ("pause", "done"):
            page.locator("button.main:visible").click()
            page.mouse.down()
        angle = 2.0 * time.monotonic()
        x = box["x"] + box["width"] * 0.2
        page.mouse.move(x, box["y"] + box["height"] * (0.5 + 0.15 * np.sin(angle)))
        drawn = state["table"]["drawn_ms"]
        if drawn is not None and state["phase"] == "play":
            told.append(float(drawn))
        page.wait_for_timeout(50)
    return told


def by_mouse(seconds: float) -> list[float]:
    """Return the latencies of the video on a page in Chromium, ms."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise SystemExit("Chromium is not installed: apt-get install chromium")
    command = [sys.executable, "-m", "marl_airhockey.cli", "teleop", "juggle", "--lab"]
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [*command, "--out", folder, "--port", "0", "--no-browser"],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        try:
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(
                    executable_path=chromium, args=ARGS
                )
                page = browser.new_page(
                    viewport={"width": 1300, "height": 700}, bypass_csp=True
                )
                page.goto(found[0])
                page.wait_for_function("window.airhockey.frames.length > 9")
                told = lead(page, seconds)
                browser.close()
        finally:
            process.terminate()
            process.wait()
    return told


def by_shadow(seconds: float) -> tuple[float, float]:
    """Return the latency of the arm, s, and its remaining position error, median, m."""
    with running_lab() as client, lab_rig() as table, hand_rig() as hand:
        client.ask("hand", **HAND)
        world = ah.make_world(
            *("reach", 1),
            backend="real",
            rig=str(table),
            options={"table": "full_size"},
            profile="ur5e",
            drivers={"paddle_0": f"shadow:rig={hand}"},
            max_cycles=round(seconds / CONTROL_DT),
        )
        reach = np.array(world.scene.seats[0].reach)
        low, high = reach.min(0), reach.max(0)
        hands, arms = [], []
        try:
            world.reset(0)
            for k in range(world.max_cycles - 1):
                result = world.step(np.zeros((1, 0, 2)))
                if result.interruption:
                    raise SystemExit(f"the arm stopped: {result.interruption}")
                seen, truth = client.ask("hand_camera"), client.ask("truth")
                if k > CAUGHT / CONTROL_DT:
                    way = (high - low) / FIELD * seen["place"]
                    hands.append([seen["time"], *((low + high) / 2 + way)])
                    arms.append([truth["time"], *truth["paddle"][:2]])
        finally:
            world.close()
    return _behind(np.array(arms), np.array(hands))


def _behind(arm: Array, hand: Array) -> tuple[float, float]:
    """Return the latency of an arm, s, and its remaining position error, median, m.

    Args:
        arm: Rows of time, s, and position, m, of the arm's paddle, (n, 3).
        hand: Rows of time, s, and position, m, of the hand, (m, 3).
    """
    inside = arm[:, 0] > hand[0, 0] + 0.5
    delay = find_delay(arm[inside], hand)
    then = arm[inside, 0] - delay
    there = np.stack([np.interp(then, hand[:, 0], hand[:, k]) for k in (1, 2)], 1)
    return delay, float(np.median(np.linalg.norm(arm[inside, 1:] - there, axis=1)))


def main(
    seconds: Annotated[float, typer.Option(help="Duration of each case, s.")] = 20.0,
) -> None:
    """Measure and print."""
    told = by_mouse(seconds)
    own = 1e3 * LabSetup().latency
    drawn = float(np.median(told))
    rows = Table("", "ms", "load")
    load = f"{os.getloadavg()[0]:.1f}"
    rows.add_row("mouse: from exposure to drawing, p50", f"{drawn:.1f}", load)
    rows.add_row("  part of the camera", f"{own:.1f}", "")
    rows.add_row("  part after the camera", f"{drawn - own:.1f}", "")
    delay, off = by_shadow(seconds)
    rows.add_row("shadow: arm behind the hand", f"{1e3 * delay:.0f}", load)
    rows.add_row("  position error, mm", f"{1e3 * off:.1f}", "")
    Console().print(rows)


if __name__ == "__main__":
    typer.run(main)
