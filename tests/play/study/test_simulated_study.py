"""A simulated study: 24 people, two crashes, one withdrawal; all is recounted."""

import csv
from collections import Counter, defaultdict

import numpy as np
import pytest
from pages import aim, line
from study_steps import enter, plan_writer, stage

from marl_airhockey.data.reader import read_head, read_recording
from marl_airhockey.play.live_match import COUNTDOWN, RATE
from marl_airhockey.play.report import summarize
from marl_airhockey.play.study.answers import read_answers
from marl_airhockey.play.study.archive import diaries
from marl_airhockey.play.study.study import open_study
from marl_airhockey.play.study.tables import by_opponent, by_question, save

PLAN = """
scenario = "duel"
version = "3"
information = "First."
agree = ["Yes."]
opponents = ["still", "goalkeeper", {name = "striker", reaction = 0.1}]
games = 2
practice = 1
practice_opponent = "still"
rest = 0
questions = [
  "origin", {id = "fun", text = "Fun?"}, {id = "why", text = "?", free = true},
]
[options]
seconds = 4.0
goals_to_win = 1
"""
PEOPLE, CRASHES, WITHDRAWS = 24, (5, 11), 8


class Simulated:
    """A person who follows the puck, late and as well as they can."""

    def __init__(self, number):
        self.rng = np.random.default_rng(number)
        self.skill = float(self.rng.uniform(0.2, 1.0))
        self.key = f"person {number}"

    def move(self, study, client):
        x, y = study.match.world.state.puck[0, 0]
        noise = 0.1 * (1.0 - self.skill) * self.rng.normal(size=2)
        goal = (x - 0.1, y) if x < -0.1 else (-0.7, 0.5 * y)
        client.limiter._level = 100.0
        study.receive(client, aim(goal[0] + noise[0], goal[1] + noise[1]))

    def game(self, study, client, ticks=None):
        study.receive(client, line("start"))
        study.tick()
        made = 0
        while study.match.phase != "done" and made != ticks:
            self.move(study, client)
            study.tick()
            made += 1
        if ticks is None:
            for _ in range(3 * RATE):
                study.tick()

    def answer(self, study, client):
        fun = int(np.clip(round(4 + 3 * self.skill + self.rng.normal()), 1, 7))
        study.receive(client, line("answer", question="origin", value=2))
        study.receive(client, line("answer", question="fun", value=fun))
        study.receive(client, line("comment", question="why", text=self.key))


@pytest.mark.slow
def test_a_study_of_24_people_loses_nothing(tmp_path):
    out, plan = tmp_path / "out", plan_writer(tmp_path)(PLAN)
    study = open_study(plan, out)
    for number in range(PEOPLE + 1):
        person = Simulated(number)
        client = enter(study, person.key)
        assert stage(study, client) == {"stage": "consent"}
        study.receive(client, line("consent", version="3"))
        crashes, withdraws = number in CRASHES, number == WITHDRAWS
        while (where := stage(study, client)["stage"]) != "end":
            if where == "ready" and crashes and stage(study, client)["block"] == 1:
                # No goal can end the game so soon after the countdown.
                person.game(study, client, ticks=round((COUNTDOWN + 0.25) * RATE))
                assert study.match.phase == "play"
                study.host.recorder._writer._lock.release()  # As a kill does.
                study = open_study(plan, out)
                client, crashes = enter(study, person.key), False
            elif where == "ready":
                person.game(study, client)
            elif where == "questions":
                person.answer(study, client)
            if withdraws and stage(study, client)["stage"] == "questions":
                study.receive(client, line("withdraw"))
                break
        study.receive(client, line("next"))
        study.disconnect(client)
    recount(out, tmp_path / "report")


def recount(out, report):
    found = read_answers(out)
    assert (found.participants, found.complete) == (PEOPLE, PEOPLE)
    assert sorted(diary.number for diary in diaries(out)) == list(range(PEOPLE))
    counted = found.counted()
    assert len(counted) == PEOPLE * 6
    results = Counter(row["result"] for row in found.games)
    assert results["cut off"] == len(CRASHES)
    for row in found.games:
        if row["result"] == "cut off":
            (path,) = out.glob(f"*/{row['recording']}")
            assert read_head(path)["study"]["opponent"] == row["opponent"]
    orders = defaultdict(set)
    for row in counted:
        orders[row["opponent"], row["block"]].add(row["participant"])
    assert {len(people) for people in orders.values()} == {PEOPLE // 3}, "balanced"
    goals = Counter()
    for row in counted:
        (path,) = out.glob(f"*/{row['recording']}")
        (episode,) = read_recording(path).episodes
        home, far = episode.columns["memory.goals"][-1]
        assert row["score"].startswith(f"goals {home:.0f} : {far:.0f}")
        won, lost = episode.columns["success"][-1].astype(bool)
        expected = "won" if won else "lost" if lost else "drawn"
        assert row["result"] == expected
        assert read_head(path)["study"]["opponent"] == row["opponent"]
        goals[row["opponent"]] += home - far
    for row in by_opponent(found):
        own = [g for g in counted if g["opponent"] == row["opponent"]]
        points = {"won": 1.0, "drawn": 0.5, "lost": 0.0}
        mean = np.mean([points[g["result"]] for g in own])
        assert row["score"][0] == pytest.approx(mean)
        assert row["score"][1] <= mean <= row["score"][2]
        assert (row["n"], row["games"]) == (PEOPLE, 2 * PEOPLE)
        sums = summarize(out).players[row["opponent"]]
        assert np.mean(sums.points) == pytest.approx(1.0 - mean)
    assert {row["n"] for row in by_question(found)} == {PEOPLE}
    files = {path.name: path for path in save(found, report)}
    with files["measures.csv"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    margins = Counter()
    for row in rows:
        sign = {"goals": 1.0, "goals of others": -1.0}.get(row["measure"], 0.0)
        margins[row["opponent"]] += sign * float(row["value"])
    assert margins == goals
