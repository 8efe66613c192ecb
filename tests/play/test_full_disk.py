"""A disk that takes nothing more: matches and studies go on, and say so."""

import errno
import json
import os

import pytest
from disks import largest_file
from pages import line
from study_steps import answer, consent, enter, plan_writer, play, stage

from marl_airhockey.data.reader import read_recording
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.study.answers import read_answers
from marl_airhockey.play.study.archive import DIARY, diaries
from marl_airhockey.play.study.study import open_study


def run_a_match(session, client, ticks):
    session.receive(client, line("start"))
    for _ in range(ticks):
        session.tick()


@pytest.fixture
def table(tmp_path):
    options = {"options": {"seconds": 20.0}}
    match = LiveMatch("duel", {"paddle_1": "still"}, options, seed=1)
    session = open_table(match, Recorder(tmp_path))
    yield session
    session.host.recorder.end(match, "enough")


def test_a_match_goes_on_unrecorded(table, tmp_path):
    client = table.connect()
    table.receive(client, line("hello", key="k"))
    run_a_match(table, client, 5 * RATE)
    assert json.loads(client.frame)["recording"]
    recorder = table.host.recorder
    with largest_file(200):
        recorder._writer._flushed = 0.0
        run_a_match(table, client, 1)
        # A thread writes; the first step after it has failed says so.
        recorder._writer._disk._thread.submit(int).result()
        run_a_match(table, client, 1)
    assert table.match.phase == "play"
    state = json.loads(client.frame)
    assert not state["recording"]
    assert state["not_recorded"] == os.strerror(errno.EFBIG)
    (path,) = tmp_path.iterdir()
    assert len(read_recording(path).episodes) <= 1, "what was written can be read"
    table.receive(client, line("stop"))
    run_a_match(table, client, 5 * RATE)
    assert json.loads(client.frame)["recording"], "the next one is tried again"


def test_a_recording_that_cannot_begin_ends_no_match(table, tmp_path):
    client = table.connect()
    table.receive(client, line("hello", key="k"))
    with largest_file(0):
        run_a_match(table, client, 5 * RATE)
    assert table.match.phase == "play"
    assert json.loads(client.frame)["not_recorded"]
    assert not list(tmp_path.iterdir())


def test_the_newest_recordings_are_kept(tmp_path):
    options = {"options": {"seconds": 1.0}}
    match = LiveMatch("duel", {"paddle_1": "still"}, options, seed=1)
    session = open_table(match, Recorder(tmp_path, keep=2))
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    (tmp_path / "20200101-000000-duel").mkdir()
    made = []
    for _ in range(4):
        run_a_match(session, client, 5 * RATE)
        made.append(session.host.recorder.path.name)
        assert match.phase == "done"
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["20200101-000000-duel", *made[-2:]], "none but our own is deleted"


def test_a_diary_is_written_when_the_disk_takes_it_again(tmp_path):
    out = tmp_path / "out"
    study = open_study(plan_writer(tmp_path)(), out)
    client = enter(study, "a")
    consent(study, client)
    play(study, client)
    (diary,) = diaries(out)
    size = (diary.folder / DIARY).stat().st_size
    with largest_file(size + 10):
        play(study, client)
        assert stage(study, client)["stage"] == "questions"
        assert json.loads(client.frame)["not_recorded"]
        answer(study, client)
        assert stage(study, client)["block"] == 1
    assert (diary.folder / DIARY).stat().st_size == size, "no half lines"
    study.host.check_presence(0.0)
    assert not study.host.people.participant.diary.failure
    found = read_answers(out)
    assert len(found.games) == 2
    assert len(found.answers) == 2


def test_a_consent_that_cannot_be_saved_admits_nobody(tmp_path):
    out = tmp_path / "out"
    study = open_study(plan_writer(tmp_path)(), out)
    client = enter(study, "a")
    out.write_text("a file is in the way")
    with pytest.raises(ValueError, match="data cannot be stored"):
        consent(study, client)
    assert stage(study, client)["stage"] == "consent"
