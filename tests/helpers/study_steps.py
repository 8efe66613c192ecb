"""Steps of a participant that tests of studies share."""

import json

from pages import line

from marl_airhockey.play.live_match import RATE
from marl_airhockey.play.study.plan_file import load_plan

PLAN = """
scenario = "duel"
version = "3"
information = "First.\\n\\nSecond."
agree = ["Yes."]
opponents = ["still", {name = "striker", reaction = 0.1}]
games = 1
practice = 1
practice_opponent = "still"
rest = 0
questions = ["origin", {id = "fun", text = "Fun?"}]
[options]
seconds = 1.0
"""


def enter(study, key):
    client = study.connect()
    study.receive(client, line("hello", key=key))
    study.tick()
    return client


def stage(study, client):
    study.tick()
    client.limiter._level = 100.0
    return json.loads(client.frame)["study"]


def consent(study, client):
    study.receive(client, line("consent", version="3"))


def play(study, client):
    study.receive(client, line("start"))
    study.tick()
    assert study.match.phase == "countdown"
    while study.match.phase != "done":
        study.tick()
    assert stage(study, client)["stage"] == "over"
    for _ in range(3 * RATE):
        study.tick()


def answer(study, client, fun=5):
    study.receive(client, line("answer", question="origin", value=2))
    study.receive(client, line("answer", question="fun", value=fun))


def plan_writer(folder):
    """A function that writes a plan's text into a folder and loads it."""

    def write(text=PLAN):
        path = folder / "plan.toml"
        path.write_text(text)
        return load_plan(path)

    return write
