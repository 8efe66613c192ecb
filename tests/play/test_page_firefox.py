"""The page in Firefox, where it is installed."""

import pytest
from firefox import PROGRAM, firefox
from pages import served

STATE = "window.airhockey.state()"


@pytest.mark.slow
@pytest.mark.skipif(PROGRAM is None, reason="Firefox is not installed")
def test_a_person_plays_in_firefox():
    with served("duel", "--opponent", "still") as (address, _), firefox() as page:
        page.open(address)
        page.wait("window.airhockey.frames.length > 5")
        page.wait("document.querySelector('#start h1').innerText === 'Air hockey'")
        page.run("document.querySelector('#go').click()")
        page.wait(f"{STATE}.phase === 'play'")
        place = "window.airhockey.view.toScreen(-0.5, 0.15)"
        x, y = page.run(f"Array.from({place})")
        page.point(x, y)
        page.wait(
            f"Math.hypot({STATE}.paddles[0][0] + 0.5, {STATE}.paddles[0][1] - 0.15)"
            " < 0.03"
        )
