"""A study whose server is killed keeps all but the last second of a game."""

import asyncio
import json

import pytest
import websockets
from pages import line, running
from study_steps import PLAN

from marl_airhockey.data.reader import read_recording
from marl_airhockey.play.live_match import RATE
from marl_airhockey.play.study.answers import CUT_OFF, read_answers
from marl_airhockey.play.study.archive import diaries


async def _take_part(url):
    """Consent and play the practice game; return the number of the last frame."""
    async with websockets.connect(url) as participant:
        await participant.send(line("hello", key="participant"))
        begun = False
        while True:
            data = json.loads(await asyncio.wait_for(participant.recv(), 10))
            if data["t"] != "state":
                continue
            stage = data["study"]["stage"]
            if stage == "consent":
                await participant.send(line("consent", version="3"))
            elif stage == "ready" and not begun:
                await participant.send(line("start"))
                begun = True
            elif data["n"] >= 3 * RATE:
                return data["n"]


@pytest.mark.slow
def test_killed_study_loses_less_than_a_second_of_a_game(tmp_path):
    plan, out = tmp_path / "plan.toml", tmp_path / "out"
    plan.write_text(PLAN.replace("seconds = 1.0", "seconds = 60.0"))
    words = "study", "run", str(plan), "--out", str(out), "--port", "0", "--no-browser"
    with running(*words) as (address, server):
        url = address.replace("http", "ws").rstrip("/") + "/ws"
        shown = asyncio.run(_take_part(url))
        server.kill()
        server.wait(10)
    (diary,) = diaries(out)
    kinds = ["diary", "consent", "begin", "recording"]
    assert [row["kind"] for row in diary.rows] == kinds
    (game,) = read_answers(out).games
    assert (game["result"], game["practice"]) == (CUT_OFF, True)
    (path,) = diary.folder.glob("*-duel")
    assert game["recording"] == path.name
    (episode,) = read_recording(path).episodes
    assert episode.reason == ""
    assert len(episode) >= shown - RATE
