"""The page of a match or a study, in headless Chromium."""

import time

import numpy as np
import pytest
from pages import page_at, point_of, press, running, served, state_of, wait
from study_steps import plan_writer

from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.recorder import Recorder


def strike_until_done(page):
    """Play against an opponent that does not move, until the match is over."""
    began = time.monotonic()
    while (state := state_of(page))["phase"] == "play":
        # Get behind the puck, then through it.
        x, y = state["pucks"][0][:2]
        behind = state["paddles"][0][0] < x - 0.06
        page.mouse.move(*point_of(page, min(x, -0.06) if behind else x - 0.2, y))
        page.wait_for_timeout(16)
        assert time.monotonic() - began < 55, "no goal against nobody"
    wait(page, "s.phase === 'done'")


@pytest.mark.slow
def test_the_best_goal_is_saved_as_a_video(browser, tmp_path):
    av = pytest.importorskip("av")
    complaints = []
    options = ("--opponent", "still", "--option", "goals_to_win=1")
    with served("duel", *options) as (address, _):
        page = page_at(browser, address, complaints, accept_downloads=True)
        button = page.get_by_role("button", name="Save the best goal as a video")
        page.keyboard.press("Space")
        wait(page, "s.phase === 'play'")
        strike_until_done(page)
        page.locator("#card h1").wait_for()
        if state_of(page)["success"] != [0]:
            pytest.skip("it was an own goal")
        assert "longest streak" in page.locator("#card").inner_text()
        with page.expect_download(timeout=60_000) as download:
            button.click()
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        page.close()
    assert not complaints
    with av.open(str(path)) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
        codec = video.streams.video[0].codec_context.name
    assert codec in ("h264", "vp9", "vp8")
    assert frames[0].shape == (720, 1280, 3)
    assert len(frames) > 60
    last = frames[-1].astype(float)
    assert max(np.abs(last - frame).max() for frame in frames[::10]) > 100


def test_a_person_plays_in_the_browser(browser):
    complaints = []
    with served("duel", "--option", "goals_to_win=1") as (address, _):
        page = page_at(browser, address, complaints)
        assert state_of(page)["seat"] == 0
        page.wait_for_function("airhockey.state().demo.pucks.length === 1")
        page.keyboard.press("Space")
        wait(page, "s.phase === 'play'")
        # The champion soon scores against who stands beside the goal.
        page.mouse.move(*point_of(page, -0.5, 0.25))
        wait(page, "Math.hypot(s.paddles[0][0] + 0.5, s.paddles[0][1] - 0.25) < 0.03")
        # The goal is shown again before the card.
        page.locator("#moment").get_by_text("Replay").wait_for()
        assert not page.locator("#card").is_visible()
        page.locator("#card h1").wait_for()
        assert page.locator("#card h1").inner_text() in ("You win!", "You lose")
        assert "shots on goal" in page.locator("#card").inner_text()
        # The name of the button depends on the winner.
        page.keyboard.press("Space")
        wait(page, "s.phase === 'play' && s.n < 60")
        page.close()
    assert not complaints


def test_a_page_is_loaded_again_and_closed(browser):
    complaints = []
    with served("duel", "--opponent", "still") as (address, _):
        page = page_at(browser, address, complaints)
        page.keyboard.press("Space")
        wait(page, "s.phase === 'play'")
        watcher = page_at(browser, address, complaints, color_scheme="dark")
        assert state_of(watcher)["seat"] is None
        page.reload()
        page.wait_for_function("window.airhockey.frames.length > 5")
        wait(page, "s.seat === 0 && s.phase === 'play'")
        page.close()
        wait(watcher, "s.phase === 'pause'")
        watcher.close()
    assert not complaints


@pytest.mark.slow
def test_games_are_changed_on_the_start_screen(browser):
    complaints = []
    with served() as (address, _):
        page = page_at(browser, address, complaints)
        for _ in range(2):
            press(page, "Tasks")
            page.get_by_role("button", name="Juggle", exact=True).wait_for()
            wait(page, "s.seats.length === 1")
            press(page, "Ladder")
            page.get_by_role("button", name="Gentle").wait_for()
            press(page, "Together")
            page.get_by_text("Waiting for another player").wait_for()
        page.close()
    assert not complaints


@pytest.mark.slow
def test_a_task_is_ten_tries_on_a_phone(browser):
    complaints = []
    with served("juggle", "--option", "seconds=0.5") as (address, _):
        page = page_at(
            *(browser, address, complaints),
            color_scheme="dark",
            viewport={"width": 390, "height": 844},
        )
        press(page, "Play")
        wait(page, "s.phase === 'play'")
        assert not page.locator("#foot").is_visible(), "no controls in play"
        page.mouse.move(*point_of(page, -0.6, 0.0))
        wait(page, "Math.abs(s.paddles[0][1]) < 0.03 && s.ack > 0")
        page.locator("#detail").get_by_text("Hits 0 of 4").wait_for()
        page.locator("#headline").get_by_text("0 of 10").wait_for()
        press(page, "Menu")
        page.get_by_text("Your best today: 0.").wait_for()
        page.close()
    assert not complaints


def test_a_recording_is_watched_in_the_page(browser, tmp_path):
    match = LiveMatch("duel", {"paddle_0": "striker", "paddle_1": "still"}, {}, seed=1)
    session = open_table(match, Recorder(tmp_path))
    match.start()
    for _ in range(8 * RATE):
        session.tick()
    session.host.recorder.end(match, "enough")
    (path,) = tmp_path.iterdir()
    complaints = []
    with running("watch", str(path)) as (address, _):
        page = page_at(browser, address, complaints)
        wait(page, "s.n > 30")
        page.locator("#pause").click()
        page.locator("#scrub").fill("200")
        wait(page, "s.n === 200")
        page.locator("#speed").select_option("4")
        page.locator("#pause").click()
        wait(page, "s.n > 260")
        page.get_by_text("Ended early").wait_for()
        page.locator("#scrub").fill("0")
        wait(page, "s.n === 0")
        page.locator("#scrub").fill(page.locator("#scrub").get_attribute("max"))
        page.get_by_text("Ended early").wait_for()
        page.get_by_text("enough").wait_for()
        page.close()
    assert not complaints


@pytest.mark.slow
def test_a_participant_in_the_browser(browser, tmp_path):
    plan_writer(tmp_path)()
    complaints = []
    words = ("study", "run", str(tmp_path / "plan.toml"), "--out", str(tmp_path / "o"))
    with running(*words, "--port", "0", "--no-browser") as (address, _):
        page = page_at(browser, address, complaints)
        go = page.get_by_role("button", name="Take part")
        assert go.is_disabled()
        page.get_by_role("checkbox").check()
        go.click()
        for _ in range(2):
            wait(page, "s.study.stage === 'ready'")
            page.locator("#choices").get_by_role("button").first.click()
            wait(page, "s.phase === 'play'")
            page.keyboard.down("ArrowUp")
            wait(page, "s.paddles[0][1] > 0.1 || s.phase === 'done'")
            page.keyboard.up("ArrowUp")
        wait(page, "s.study.stage === 'questions'")
        page.get_by_label("a computer").check()
        page.reload()
        page.get_by_label("a computer").check()
        go = page.get_by_role("button", name="Continue")
        assert go.is_disabled()
        page.get_by_label("6", exact=True).check()
        go.click()
        wait(page, "s.study.stage === 'ready' && s.study.block === 1")
        page.get_by_role("button", name="Withdraw").click()
        page.get_by_role("button", name="Stay").click()
        page.get_by_role("button", name="Withdraw").click()
        page.get_by_role("button", name="Erase everything").click()
        wait(page, "s.study.stage === 'erased'")
        page.get_by_role("button", name="Next participant").click()
        page.get_by_role("button", name="Take part").wait_for()
        page.close()
    assert not complaints
    kept = [
        p.name for p in (tmp_path / "o").rglob("*.json*") if p.name != "report.json"
    ]
    assert kept == ["erased.jsonl"]
