"""The report of a study: one name per opponent, whole rows, texts that stay texts."""

import csv
import hashlib
import runpy
from pathlib import Path

import numpy as np
import pytest
from pages import aim, line
from study_steps import PLAN, consent, enter, plan_writer, play, stage

from marl_airhockey.data.reader import read_head
from marl_airhockey.play.cells import markdown, write_csv
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.protocol import LONGEST
from marl_airhockey.play.report import summarize
from marl_airhockey.play.study.answers import CUT_OFF, read_answers
from marl_airhockey.play.study.study import open_study
from marl_airhockey.play.study.tables import (
    by_opponent,
    by_participant,
    save,
    to_markdown,
)
from marl_airhockey.policies.load import ZOO

ROOT = Path(__file__).parents[3]
FREE = PLAN.replace(
    '{id = "fun", text = "Fun?"}', '{id = "why", text = "?", free = true}'
)
NAMED = FREE.replace(
    '{name = "striker", reaction = 0.1}',
    '{name = "striker", label = "=slow | steady", reaction = 0.1}',
).replace("version", 'debriefing = "All were computers."\nversion')
DEVICE = {"input": "touch", "width": 390, "height": 760, "density": 3.0, "hz": 60.0}


def answer(study, client, text):
    study.receive(client, line("answer", question="origin", value=2))
    study.receive(client, line("comment", question="why", text=text))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of one participant, with a crash in a game."""
    where = tmp_path_factory.mktemp("study")
    out, plan = where / "out", plan_writer(where)(NAMED)
    study = open_study(plan, out)
    client = enter(study, "a")
    consent(study, client)
    study.receive(client, line("device", **DEVICE))
    play(study, client)
    study.receive(client, line("start"))
    for _ in range(200):
        study.receive(client, aim(-0.4, 0.1))
        study.tick()
        client.limiter._level = 100.0
    study.host.recorder._writer._lock.release()
    study = open_study(plan, out)  # The server was killed and runs again.
    client = enter(study, "a")
    study.receive(client, line("device", **DEVICE))
    for text in ("=1+1 | said\nthe page", ""):
        assert stage(study, client)["debriefing"] == []
        play(study, client)
        with pytest.raises(ValueError, match="comment: origin is not in the plan"):
            study.receive(client, line("comment", question="origin", text="x"))
        with pytest.raises(ValueError, match=f"at most {LONGEST} characters"):
            study.receive(
                client, line("comment", question="why", text="x" * (LONGEST + 1))
            )
        answer(study, client, text)
    assert stage(study, client)["debriefing"] == ["All were computers."]
    return out


def test_a_game_that_was_cut_off_names_its_recording(folder):
    rows = [g for g in read_answers(folder).games if g["result"] == "cut off"]
    assert len(rows) == 1
    assert len(list(folder.glob(f"*/{rows[0]['recording']}"))) == 1


def test_an_opponent_has_one_name_everywhere(folder):
    label = "=slow | steady"
    found = read_answers(folder)
    assert label in {row["opponent"] for row in found.answers}
    assert label in {row["opponent"] for row in found.games}
    assert label in summarize(folder).players
    assert label in {row["opponent"] for row in by_opponent(found)}
    assert label in by_participant(found)[0]
    text = to_markdown(found) + summarize(folder).to_markdown()
    assert "=slow \\| steady" in text
    assert label not in text
    assert "striker (reaction" not in text


def test_a_game_that_a_crash_has_cut_off_has_a_row(folder):
    found = read_answers(folder)
    results = [row["result"] for row in found.games]
    assert results.count(CUT_OFF) == 1
    assert len(results) == 4
    assert len(found.counted()) == 2


def test_tables_have_numbers_as_numbers_and_texts_as_texts(folder, tmp_path):
    files = {path.name: path for path in save(read_answers(folder), tmp_path)}
    with files["measures.csv"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["measure"] for row in rows} == {
        *("points", "seconds", "pauses", "origin"),
        *("goals", "goals of others", "shots", "shots of others"),
    }
    assert all(np.isfinite(float(row["value"])) for row in rows)
    with files["games.csv"].open(newline="") as file:
        games = list(csv.DictReader(file))
    played = [game for game in games if game["result"] != CUT_OFF]
    assert {game["input"] for game in played} == {"touch"}
    assert {(game["width"], game["hz"]) for game in played} == {("390", "60.0")}
    assert "rule" in games[0]
    assert {game["opponent"] for game in games} >= {"'=slow | steady"}
    with files["answers.csv"].open(newline="") as file:
        answers = list(csv.DictReader(file))
    words = [row["text"] for row in answers if row["question"] == "why"]
    assert words == ["'=1+1 | said\nthe page", ""]


def test_recordings_name_policies_and_devices(folder):
    heads = [read_head(path) for path in sorted(folder.glob("*/*-duel"))]
    assert {tuple(head["policies"]) for head in heads} == {("", "")}
    assert all(head["devices"] == [DEVICE, None] for head in heads)


def test_cells_are_escaped(tmp_path):
    assert markdown(("a|b",), [("c\nd",)]) == ["| a\\|b |", "| --- |", "| c d |"]
    rows = [{"x": "@sum", "y": -1.5}, {"x": "-", "y": 2}]
    write_csv(tmp_path / "t.csv", ("x", "y"), rows)
    assert (tmp_path / "t.csv").read_text().split() == ["x,y", "'@sum,-1.5", "'-,2"]


def test_intervals_of_a_report_contain_the_truth():
    script = runpy.run_path(str(ROOT / "scripts/reproduce/study_intervals.py"))
    for name, covered in script["coverage"](200).items():
        assert 0.93 <= covered <= 0.97, name


def test_a_policy_is_known_by_its_digest():
    match = LiveMatch("duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {})
    script, policy = match.drivers.digests
    assert script == ""
    assert policy == hashlib.sha256((ZOO / "duel.npz").read_bytes()).hexdigest()[:16]
