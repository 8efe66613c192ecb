"""What tests of the page share: messages, a running server, a page in a browser."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys


def line(kind, **fields):
    return json.dumps({"t": kind, **fields})


def aim(x, y, q=1, held=0):
    return line("aim", x=x, y=y, held=held, q=q, rtt=0)


@contextlib.contextmanager
def running(*words):
    command = [sys.executable, "-m", "marl_airhockey.cli", *words]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "BROWSER": "true"},
    )
    try:
        addresses = (re.search(r"http://\S+", text) for text in process.stdout)
        yield next(filter(None, addresses))[0], process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(10)
        process.stdout.close()


def page_at(browser, address, complaints, **options):
    options = {"viewport": {"width": 1000, "height": 640}, **options}
    page = browser.new_page(bypass_csp=True, **options)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "console", lambda m: complaints.append(m.text) if m.type == "error" else None
    )
    page.goto(address)
    page.wait_for_function("window.airhockey.frames.length > 5")
    return page


def press(page, text):
    """Click a button by its text, once it is there."""
    page.get_by_role("button", name=text, exact=True).click()


def point_of(page, x, y):
    """The point of the window at a point of the table, px."""
    box = page.locator("#table").bounding_box()
    pixels = "airhockey.view.toScreen(x, y).map((v) => v / devicePixelRatio)"
    across, down = page.evaluate(f"([x, y]) => {pixels}", [x, y])
    return box["x"] + across, box["y"] + down


def state_of(page):
    return page.evaluate("window.airhockey.state()")


def wait(page, condition):
    page.wait_for_function(
        f"(() => {{ const s = airhockey.state(); return {condition}; }})()"
    )


@contextlib.contextmanager
def served(*options):
    """The address of a running `airhockey play`, and its process."""
    options = ("play", *options, "--port", "0", "--no-browser")
    with running(*options) as (address, process):
        yield address, process
