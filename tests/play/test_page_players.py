"""The page in Chromium, for players: departures, results, links, fingers, words."""

import re
import time

import pytest
from pages import page_at, served, state_of, wait
from slow_link import SlowLink

HEADLINE = "document.querySelector('#headline').innerText"
DETAIL = "document.querySelector('#detail').innerText"


@pytest.mark.slow
def test_who_remains_is_offered_ways_on(browser):
    complaints = []
    with served("duel", "--driver", "paddle_1=person") as (address, _):
        one, other = (page_at(browser, address, complaints) for _ in range(2))
        wait(other, "s.seat === 1")
        one.locator("#go").click()
        wait(one, "s.phase === 'play'")
        other.close()
        wait(one, "s.phase === 'pause'")
        one.wait_for_function(
            f"{DETAIL}.startsWith('A player has disconnected. You can')"
        )
        assert one.locator("#stop").is_visible()
        one.get_by_role("button", name="Continue against the computer").click()
        wait(one, "s.phase === 'play' && s.seats[1].driver === 'zoo/duel'")
        assert one.locator(".seat").nth(1).inner_text() == "Champion at human speed"
        one.locator("#leave").click()
        stranger = page_at(browser, address, complaints)
        wait(stranger, "s.seat === 0 && s.phase === 'lobby'")
        assert stranger.evaluate(HEADLINE) == "Ready?"
        for page in (one, stranger):
            page.close()
    assert not complaints


@pytest.mark.slow
def test_a_level_game_is_explained_and_a_golden_goal_offered(browser):
    complaints = []
    options = ("--option", "seconds=1", "--opponent", "goalkeeper")
    with served("duel", *options) as (address, _):
        page = page_at(browser, address, complaints)
        page.locator("#go").click()
        wait(page, "s.phase === 'done'")
        page.wait_for_function(f"{HEADLINE} === 'A draw'")
        assert page.evaluate(DETAIL) == "Same score: goals 0 : 0, shots 0 : 0."
        page.locator("#golden").click()
        wait(page, "s.phase === 'play' && s.golden_goal")
        assert "next goal wins" in page.locator("#name").inner_text()
        page.close()
    assert not complaints


@pytest.mark.slow
def test_a_slow_link_shows_fresh_frames_and_says_so(browser):
    with served("duel", "--opponent", "still", "--option", "seconds=600") as (at, _):
        link = SlowLink(int(re.search(r":(\d+)/", at)[1]), 100e3)
        direct = page_at(browser, at, [])
        slow = page_at(browser, f"http://127.0.0.1:{link.port}/", [])
        direct.locator("#go").click()
        time.sleep(8.0)
        slow.get_by_text("slow link: 10 frames per second").wait_for()
        ages = ages_of(slow, direct)
        assert len(ages) > 50
        assert max(ages) < 500.0, "ms"
        for page in (slow, direct):
            page.close()


def ages_of(page, direct):
    """Times by which frames come later to a page than to another one, ms."""
    script = (
        "airhockey.numbers.map((number, i) => "
        "[number, performance.timeOrigin + airhockey.frames[i]])"
    )
    arrivals = [dict(each.evaluate(script)) for each in (page, direct)]
    return [
        at - arrivals[1][number]
        for number, at in arrivals[0].items()
        if number in arrivals[1]
    ]


def test_the_first_finger_steers_and_the_paddle_is_above_it(browser):
    complaints = []
    with served("duel", "--opponent", "still") as (address, _):
        page = page_at(
            *(browser, address, complaints),
            has_touch=True,
            is_mobile=True,
        )
        page.set_viewport_size({"width": 390, "height": 760})
        assert "Drag a finger" in page.evaluate(DETAIL)
        page.locator("#go").tap()
        wait(page, "s.phase === 'play'")
        box = page.locator("#table").bounding_box()
        metre = box["height"] / 2.0  # A little more than the length of the table.
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        session = page.context.new_cdp_session(page)

        def touch(kind, *points):
            fingers = [{"x": x, "y": y, "id": k} for k, (x, y) in points]
            session.send(
                "Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers}
            )

        first = middle[0], middle[1] + 0.5 * metre
        touch("touchStart", (0, first))
        wait(page, "s.ack > 0 && Math.abs(s.paddles[0][1]) < 0.03")
        page.wait_for_timeout(700)
        held = state_of(page)["paddles"][0]
        where = (
            page.evaluate(f"toScreen({held[0]}, {held[1]})[1] / devicePixelRatio")
            + box["y"]
        )
        assert 40 < first[1] - where < 80, "px above the finger"
        touch("touchStart", (0, first), (1, (middle[0] - 60, first[1])))
        touch("touchMove", (0, first), (1, (middle[0] - 90, first[1] - 40)))
        page.wait_for_timeout(700)
        after = state_of(page)["paddles"][0]
        assert abs(after[0] - held[0]) + abs(after[1] - held[1]) < 0.02
        touch("touchEnd", (1, (middle[0] - 90, first[1] - 40)))
        page.close()
    assert not complaints


def test_the_first_screen_is_in_words_of_players(browser):
    complaints = []
    with served("duel") as (address, _):
        page = page_at(browser, address, complaints)
        state = state_of(page)
        assert state["seats"][1]["level"] == "champion at human speed"
        text = page.locator("body").inner_text()
        for word in ("policy", "loop", "Hz", "handicap", "zoo", "round trip"):
            assert word not in text, word
        assert page.title() == "Air hockey: duel"
        assert page.locator("#sound").get_attribute("aria-pressed") == "true"
        page.locator("summary").click()
        assert "zoo/duel" in page.locator("#drivers").inner_text()
        assert re.search(r"loop [\d.]+ Hz", page.locator("#rate").inner_text())
        key = page.evaluate("key")
        assert re.fullmatch("[0-9a-f]{32}", key)
        page.close()
    assert not complaints
