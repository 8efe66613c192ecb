"""Teleoperation of the lab's arm on its live video, in headless Chromium."""

import threading
import time

import numpy as np
import pytest
from pages import page_at, point_of, running, state_of, wait

from marl_airhockey.data.exchange.seats import all_rows
from marl_airhockey.data.extract import extract
from marl_airhockey.data.reader import read_recording
from marl_airhockey.hardware.lab.lab import LabClient


def begin(page):
    """Begin an episode; after a stop of the arm, look at it and let it go on."""
    page.locator("button.main:visible").click()
    until = time.monotonic() + 40
    while (state := state_of(page))["phase"] != "play":
        assert time.monotonic() < until, state["reason"]
        if "May it continue?" in state["reason"]:
            page.wait_for_timeout(5600)
        if state["phase"] in ("pause", "done"):
            page.locator("button.main:visible").click()
        page.wait_for_timeout(30)


def point(page, x, y):
    """Move the pointer to a place of the table."""
    page.mouse.move(*point_of(page, x, y))


class Truth(threading.Thread):
    """Thread that asks a lab for its truth: rows time, puck, paddle."""

    def __init__(self, client):
        super().__init__(daemon=True)
        self.client, self.rows, self.ended = client, [], threading.Event()

    def run(self):
        while not self.ended.wait(0.008):
            truth = self.client.ask("truth")
            self.rows.append([truth["time"], *truth["puck"], *truth["paddle"][:2]])

    def stop(self):
        self.ended.set()
        self.join()
        return np.array(self.rows)


def lead(page, seconds):
    """Keep the paddle under the puck."""
    until = time.monotonic() + seconds
    while time.monotonic() < until and (state := state_of(page))["phase"] == "play":
        point(page, -0.6, np.clip(state["pucks"][0][1], -0.2, 0.2))
        page.wait_for_timeout(15)


@pytest.fixture
def teleop(browser, tmp_path):
    complaints = []
    words = ("teleop", "juggle", "--lab", "--out", str(tmp_path), "--port", "0")
    with running(*words, "--no-browser") as (address, _):
        client = LabClient.find()
        page = page_at(browser, address, complaints)
        yield page, client, tmp_path
        page.close()
        client.close()
    assert not complaints


def led_episode(page, client):
    """Begin an episode, hold the button down and play; return rows of the truth.

    Empty if a busy machine has ended it.
    """
    begin(page)
    page.get_by_text("hold the button down").wait_for()
    point(page, -0.6, 0.1)
    page.wait_for_timeout(300)
    still = state_of(page)["paddles"][0]
    assert state_of(page)["table"]["asked"] == [0.0, 0.0], "nobody holds it"
    page.mouse.down()
    truth = Truth(client)
    truth.start()
    lead(page, 1.8)
    rows, state = truth.stop(), state_of(page)
    # Let go: the arm comes to rest, the pointer wherever it is.
    page.mouse.up()
    point(page, -0.4, -0.2)
    if state["reason"]:
        return []
    assert np.linalg.norm(np.subtract(state["paddles"][0], still)) > 0.02
    assert state["table"]["drawn_ms"] is not None
    page.wait_for_timeout(600)
    at_rest = state_of(page)
    assert at_rest["phase"] != "play" or at_rest["table"]["asked"] == [0.0, 0.0]
    return rows


@pytest.mark.slow
def test_a_person_leads_the_arm_by_its_video(teleop):
    page, client, folder = teleop
    for _ in range(4):
        rows = led_episode(page, client)
        if len(rows):
            break
    assert len(rows), "no episode went on to its end"
    if state_of(page)["phase"] == "play":
        client.ask("fault", name="lost_puck", on=True)
    wait(page, "s.phase === 'done'")
    path = max(folder.iterdir())
    recording = read_recording(path)
    (episode,) = recording.episodes
    assert episode.columns["device.joints"].shape[-1] == 6
    assert {"device.force", "device.sent", "applied_action"} <= set(episode.columns)
    captured, received, seen, applied = (
        all_rows(episode, f"device.{name}")
        for name in ("captured", "received", "moment", "applied")
    )
    assert (captured < received).all()
    assert (received <= seen).all()
    # A command is executed in the cycle after it was given.
    assert np.median(applied[1:] - seen[:-1]) < 0.03
    assert (applied[1:] < seen[1:]).all()
    assert recording.head["players"][0]["driver"] == "person"
    # What the video shows is what was there.
    found = extract(path)
    columns = episode.columns
    clock = rows[:, 0] - columns["device.moment"][0] + columns["state.time"][0]
    inside = (found.time > clock[0]) & (found.time < clock[-1])
    times = found.time[inside]
    for places, axes in ((found.puck, (1, 2)), (found.paddle, (3, 4))):
        there = np.stack([np.interp(times, clock, rows[:, k]) for k in axes], 1)
        off = np.linalg.norm(places[inside] - there, axis=1)
        assert len(off) > 10
        assert np.isfinite(off).mean() > 0.8
        assert np.nanmedian(off) < 0.002
