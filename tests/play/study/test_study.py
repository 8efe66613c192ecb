"""Studies: a course through a plan, what is kept and what is erased."""

import json
import time

import pytest
from pages import aim, line
from study_steps import PLAN, answer, consent, enter, plan_writer, play, stage

from marl_airhockey.data.reader import read_head
from marl_airhockey.play.host import GONE, GRACE
from marl_airhockey.play.live_match import RATE
from marl_airhockey.play.report import summarize
from marl_airhockey.play.seats import IDLE
from marl_airhockey.play.study.admission import ABSENT
from marl_airhockey.play.study.answers import read_answers
from marl_airhockey.play.study.archive import diaries, erase
from marl_airhockey.play.study.study import open_study
from marl_airhockey.play.study.tables import by_question, save


@pytest.fixture
def plan(tmp_path):
    return plan_writer(tmp_path)


def test_a_participant_goes_through_a_plan(plan, tmp_path):
    out = tmp_path / "out"
    study = open_study(plan(), out)
    client, other = enter(study, "a"), enter(study, "b")
    assert stage(study, client) == {"stage": "consent"}
    assert client.seat is None
    study.receive(client, line("start"))
    assert study.match.phase == "lobby"
    assert not [*out.rglob("*.jsonl"), *out.rglob("meta.json")], (
        "nothing is kept before the consent"
    )
    with pytest.raises(ValueError, match="load the page again"):
        study.receive(client, line("consent", version="2"))
    consent(study, client)
    consent(study, other)
    assert client.seat == 0
    assert stage(study, other) == {"stage": "busy"}
    assert stage(study, client)["block"] == -1
    code = stage(study, client)["code"]
    play(study, client)  # practice
    seen = []
    for block in range(2):
        assert stage(study, client)["stage"] == "ready"
        state = json.loads(client.frame)
        assert state["study"]["block"] == block
        assert state["seats"][1] == {
            "driver": f"Opponent {block + 1}",
            "taken": True,
            "title": f"Opponent {block + 1}",
        }
        seen.append(study.match.drivers.names[1])
        play(study, client)
        assert stage(study, client)["stage"] == "questions"
        with pytest.raises(ValueError, match="fun 8"):
            study.receive(client, line("answer", question="fun", value=8))
        answer(study, client, fun=block + 3)
    assert sorted(seen) == ["still", "striker"]
    assert stage(study, client)["stage"] == "end"
    texts = json.dumps(study.describe())
    assert "striker" not in texts, "who is played stays with the leader"
    (found,) = diaries(out)
    assert [row["kind"] for row in found.rows] == [
        *("diary", "consent", "begin", "recording", "game"),
        *2 * ("begin", "recording", "game", "answer", "answer"),
        "end",
    ]
    assert found.rows[1]["version"] == "3"
    metas = [read_head(path) for path in sorted(found.folder.glob("*-duel"))]
    assert [meta["study"]["practice"] for meta in metas] == [True, False, False]
    assert metas[1]["players"][0]["person"] == code
    assert metas[1]["players"][0]["consent"] == "3"
    sums = summarize(out)
    assert sums.episodes == 2, "practice does not count"
    assert "striker (reaction 0.1)" in sums.players
    answers = read_answers(out)
    assert (answers.participants, answers.complete) == (1, 1)
    assert [row["practice"] for row in answers.games] == [True, False, False]
    assert {row["value"] for row in answers.answers if row["question"] == "fun"} == {
        3,
        4,
    }
    files = save(answers, tmp_path / "sums")
    assert files[0].read_text().count("\n") == 4
    assert all(path.stat().st_size > 50 for path in files)
    study.receive(client, line("next"))
    assert stage(study, other)["stage"] == "consent"


def test_whoever_withdraws_is_erased_and_leaves_no_gap(plan, tmp_path):
    out = tmp_path / "out"
    study = open_study(plan(), out)
    first = enter(study, "a")
    consent(study, first)
    study.receive(first, line("start"))
    for _ in range(round(3.5 * RATE)):
        study.tick()
    assert list(out.rglob("*-duel"))
    study.receive(first, line("withdraw"))
    assert stage(study, first) == {"stage": "erased"}
    assert not list(out.rglob("*-duel"))
    (line_left,) = (out / "erased.jsonl").read_text().splitlines()
    assert json.loads(line_left).keys() == {"at", "number", "files"}
    second = enter(study, "b")
    consent(study, second)
    play(study, second)
    code = stage(study, second)["code"]
    (found,) = diaries(out)
    assert found.number == 0
    with pytest.raises(ValueError, match="no data of 'xyz'"):
        erase(out, "xyz")
    assert erase(out, code) > 2
    assert not list(diaries(out))


def test_people_play_each_other_and_either_can_withdraw(plan, tmp_path):
    text = PLAN.replace('"still", {name = "striker", reaction = 0.1}', '"person"')
    out = tmp_path / "out"
    study = open_study(plan(text), out)
    subject, partner = enter(study, "a"), enter(study, "b")
    consent(study, subject)
    play(study, subject)
    assert stage(study, subject)["waits"], "the other one has not agreed yet"
    study.receive(subject, line("start"))
    assert study.match.phase != "countdown"
    assert stage(study, partner) == {"stage": "consent"}
    consent(study, partner)
    assert stage(study, partner)["stage"] == "partner"
    assert partner.seat == 1
    play(study, subject)
    assert stage(study, subject)["stage"] == "questions"
    answer(study, subject)
    games = [p for p in out.rglob("*-duel") if not read_head(p)["study"]["practice"]]
    assert [row["consent"] for row in read_head(games[0])["players"]] == ["3", "3"]
    study.receive(partner, line("withdraw"))
    assert not games[0].exists()
    assert stage(study, subject)["stage"] == "end"
    assert len(list(diaries(out))) == 1


def test_a_participant_who_goes_may_come_back_or_is_given_up(plan, tmp_path):
    study = open_study(plan(), tmp_path / "out")
    client = enter(study, "a")
    consent(study, client)
    study.receive(client, line("start"))
    for _ in range(round(3.5 * RATE)):
        study.tick()
    study.disconnect(client)
    assert (study.match.phase, study.match.reason) == ("pause", GONE)
    back = enter(study, "a")
    assert back.seat == 0
    assert study.match.phase == "countdown"
    twin = enter(study, "a")
    assert twin.seat is None, "the same page twice"
    study.host.check_presence(time.monotonic() + IDLE + 1)
    assert study.match.phase == "pause"
    assert back.seat == 0, "who thinks keeps the seat"
    study.disconnect(twin)
    study.disconnect(back)
    study.host.check_presence(time.monotonic() + IDLE + ABSENT + 2)
    assert study.host.people.participant is None
    (diary,) = diaries(tmp_path / "out")
    assert diary.rows[-1]["reason"] == "left"
    other = enter(study, "b")
    assert stage(study, other) == {"stage": "consent"}
    consent(study, other)
    study.receive(other, aim(-0.4, 0.0))
    play(study, other)
    found = list(diaries(tmp_path / "out"))
    assert {diary.rows[0]["role"] for diary in found} == {"participant"}
    assert sorted(diary.number for diary in found) == [0, 1]


def test_a_session_goes_on_after_the_server_was_cut_off(plan, tmp_path):
    out = tmp_path / "out"
    study = open_study(plan(), out)
    client = enter(study, "a")
    consent(study, client)
    code = stage(study, client)["code"]
    for _ in range(2):
        play(study, client)
    answer(study, client)
    first = study.match.drivers.names[1]
    study = open_study(plan(), out)
    other, client = enter(study, "b"), enter(study, "a")
    assert stage(study, other)["stage"] == "busy"
    again = stage(study, client)
    assert (again["code"], again["stage"], again["block"]) == (code, "ready", 1)
    assert study.match.drivers.names[1] == first, "the second opponent, as before"
    play(study, client)
    study = open_study(plan(), out)
    client = enter(study, "a")
    while stage(study, client)["stage"] == "over":
        pass
    assert stage(study, client)["stage"] == "questions"
    answer(study, client)
    assert stage(study, client)["stage"] == "end"
    study.disconnect(client)
    study.host.check_presence(time.monotonic() + GRACE + 1)
    assert study.host.people.participant is None, "who is through lets the next one in"
    answers = read_answers(out)
    assert (answers.participants, answers.complete, len(answers.answers)) == (1, 1, 4)
    assert {row["choice"] for row in answers.answers} == {"a computer", ""}
    asked = {row["question"] for row in by_question(answers)}
    assert asked == {"origin: a computer", "fun"}


def test_whom_the_leader_erases_is_out(plan, tmp_path):
    study = open_study(plan(), tmp_path / "out")
    client = enter(study, "a")
    consent(study, client)
    erase(tmp_path / "out", stage(study, client)["code"])
    study.receive(client, line("start"))
    assert stage(study, client) == {"stage": "erased"}
    consent(study, enter(study, "b"))


def test_rest_is_a_rest_and_a_task_needs_no_opponent(plan, tmp_path):
    text = (
        PLAN.replace('"duel"', '"juggle"')
        .replace('opponents = ["still", {name = "striker", reaction = 0.1}]', "")
        .replace("practice = 1", "practice = 0")
    )
    study = open_study(plan(text), tmp_path / "a")
    client = enter(study, "a")
    consent(study, client)
    play(study, client)
    answer(study, client)
    assert stage(study, client)["stage"] == "end"
    assert read_answers(tmp_path / "a").games[0]["result"] in ("won", "lost")
    study = open_study(plan(PLAN.replace("rest = 0", "rest = 50")), tmp_path / "b")
    client = enter(study, "a")
    consent(study, client)
    play(study, client)
    play(study, client)
    answer(study, client)
    assert stage(study, client)["stage"] == "rest"
    study.receive(client, line("start"))
    assert study.match.phase != "countdown"
    for _ in range(50 * RATE):
        study.tick()
    assert stage(study, client)["stage"] == "ready"
