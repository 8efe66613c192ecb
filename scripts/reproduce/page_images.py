"""Take the images of the browser page in the documentation, in headless Chromium.

    python scripts/reproduce/page_images.py

Writes docs/images/play.png: the start screen, a match with the panel of the opponent,
and the same match on a phone.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from PIL import Image
from playwright.sync_api import BrowserType, Page, sync_playwright

IMAGES = Path(__file__).parents[2] / "docs" / "images"
WIDE, PHONE = (1120, 630), (390, 844)
"""Sizes of the windows, CSS px."""
GAP = 16
"""Gap between the images, px."""


@contextmanager
def served(*options: str) -> Iterator[str]:
    """Yield the address of a page that is served."""
    command = [sys.executable, "-m", "marl_airhockey.cli", "play", *options]
    process = subprocess.Popen(
        [*command, "--port", "0", "--no-browser"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        lines = (re.search(r"http://\S+", line) for line in process.stdout)
        yield next(filter(None, lines))[0]
    finally:
        process.terminate()
        process.wait(10)


def opened(browsers: BrowserType, address: str, size: tuple[int, int]) -> Page:
    """Return a page of an address, in a browser of its own, after its first frames.

    A page that another page of the browser hides pauses its match.
    """
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise SystemExit("Chromium is not installed: apt-get install chromium")
    options = ["--no-sandbox", "--disable-gpu"]
    browser = browsers.launch(executable_path=chromium, args=options)
    window: Any = {"width": size[0], "height": size[1]}
    phone = size == PHONE
    page = browser.new_page(
        viewport=window, bypass_csp=True, has_touch=phone, is_mobile=phone
    )
    page.goto(address)
    page.wait_for_function("window.airhockey.frames.length > 90")
    return page


def taken(page: Page) -> Image.Image:
    """Return a screenshot."""
    return Image.open(BytesIO(page.screenshot())).convert("RGB")


def beside(images: list[Image.Image], height: int) -> Image.Image:
    """Return images of one height next to each other."""
    scaled = [
        im.resize((round(im.width * height / im.height), height)) for im in images
    ]
    width = sum(im.width for im in scaled) + GAP * (len(scaled) - 1)
    sheet, x = Image.new("RGB", (width, height), "white"), 0
    for im in scaled:
        sheet.paste(im, (x, 0))
        x += im.width + GAP
    return sheet


def main(
    out: Annotated[Path, typer.Option(help="Folder of the images.")] = IMAGES,
) -> None:
    """Take the screenshots."""
    with served() as address, sync_playwright() as playwright:
        page = opened(playwright.chromium, address, WIDE)
        shots = [taken(page)]
        page.get_by_role("button", name="How it thinks").click()
        page.locator("#go").click()
        page.wait_for_function("airhockey.state().phase === 'play'")
        phone = opened(playwright.chromium, address, PHONE)
        rng = np.random.default_rng(0)
        for _ in range(40):
            # Follow the puck, so that something happens.
            state = page.evaluate("airhockey.state()")
            y = float(np.clip(state["pucks"][0][1] + 0.02 * rng.normal(), -0.2, 0.2))
            point = page.evaluate(f"airhockey.view.toScreen(-0.55, {y})")
            page.mouse.move(*point)
            page.wait_for_timeout(100)
            if state["phase"] == "goal":
                page.keyboard.press("Space")
                page.wait_for_function("airhockey.state().phase === 'play'")
        shots += [taken(page), taken(phone)]
    beside(shots, 480).save(out / "play.png", optimize=True)


if __name__ == "__main__":
    typer.run(main)
