"""The page in Chromium, for players: departures, results, links, fingers, words."""

import re
import time

import pytest
from pages import page_at, point_of, press, served, state_of, wait
from slow_link import SlowLink

DETAIL = "document.querySelector('#detail').innerText"


@pytest.mark.slow
def test_who_remains_is_offered_ways_on(browser):
    complaints = []
    with served("duel", "--driver", "paddle_1=person") as (address, _):
        one, other = (page_at(browser, address, complaints) for _ in range(2))
        wait(other, "s.seat === 1")
        press(one, "Play")
        wait(one, "s.phase === 'play'")
        other.close()
        wait(one, "s.phase === 'pause'")
        one.wait_for_function(
            f"{DETAIL}.startsWith('A player has disconnected. You can')"
        )
        assert one.get_by_role("button", name="End match").is_visible()
        press(one, "Continue against the computer")
        wait(one, "s.phase === 'play' && s.seats[1].driver === 'zoo/duel'")
        assert state_of(one)["seats"][1]["level"] == "champion at human speed"
        one.keyboard.press("Space")
        press(one, "End match")
        press(one, "Menu")
        press(one, "Leave the table")
        stranger = page_at(browser, address, complaints)
        wait(stranger, "s.seat === 0 && s.phase === 'lobby'")
        stranger.get_by_role("heading", name="Air hockey").wait_for()
        for page in (one, stranger):
            page.close()
    assert not complaints


@pytest.mark.slow
def test_a_level_game_is_explained_and_a_golden_goal_offered(browser):
    complaints = []
    options = ("--option", "seconds=1", "--opponent", "goalkeeper")
    with served("duel", *options) as (address, _):
        page = page_at(browser, address, complaints)
        press(page, "Play")
        wait(page, "s.phase === 'done'")
        page.get_by_role("heading", name="A draw").wait_for()
        page.get_by_text("Same score: goals 0 : 0, shots 0 : 0.").wait_for()
        press(page, "Golden goal: the next goal wins")
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
        press(direct, "Play")
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
            viewport={"width": 390, "height": 760},
        )
        page.get_by_text("Drag a finger").wait_for()
        page.locator("#go").tap()
        wait(page, "s.phase === 'play'")
        session = page.context.new_cdp_session(page)

        def touch(kind, *points):
            fingers = [{"x": x, "y": y, "id": k} for k, (x, y) in points]
            session.send(
                "Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers}
            )

        def paddle_below(finger):
            """How far the paddle is above a finger after a while, px."""
            page.wait_for_timeout(700)
            return finger[1] - point_of(page, *state_of(page)["paddles"][0])[1]

        first = point_of(page, -0.4, 0.0)
        touch("touchStart", (0, first))
        wait(page, "s.ack > 0 && Math.abs(s.paddles[0][1]) < 0.03")
        above = paddle_below(first)
        assert 40 < above < 80
        other = first[0] - 60, first[1]
        touch("touchStart", (0, first), (1, other))
        touch("touchMove", (0, first), (1, (other[0] - 30, other[1] - 40)))
        assert abs(paddle_below(first) - above) < 8, "the second finger is ignored"
        rail = point_of(page, -0.81, 0.0)
        touch("touchMove", (0, rail))
        paddle = state_of(page)["paddles"][0]
        wait(page, "s.paddles[0][0] < -0.78")
        assert paddle_below(rail) < 12, "the own rail can be reached"
        assert paddle[1] == pytest.approx(0.0, abs=0.03)
        touch("touchEnd", (1, first))
        page.close()
    assert not complaints


def test_the_first_screen_is_in_words_of_players(browser):
    complaints = []
    with served("duel") as (address, _):
        page = page_at(browser, address, complaints)
        state = state_of(page)
        assert state["seats"][1]["level"] == "champion at human speed"
        text = page.locator("body").inner_text()
        unfit = (
            "policy",
            "loop",
            "Hz",
            "handicap",
            "zoo",
            "round trip",
            "return",
            "duel",
        )
        for word in unfit:
            assert word not in text, word
        assert page.title() == "Air hockey: One on one"
        assert page.locator("#sound").get_attribute("aria-pressed") == "true"
        page.locator("summary").click()
        assert "zoo/duel" in page.locator("#drivers").inner_text()
        assert re.search(r"loop [\d.]+ Hz", page.locator("#rate").inner_text())
        key = page.evaluate("airhockey.key")
        assert re.fullmatch("[0-9a-f]{32}", key)
        page.close()
    assert not complaints
