"""Files that are no recordings of games: reports skip them, with a line for each."""

import json
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.replay import replay_of
from marl_airhockey.play.report import summarize
from marl_airhockey.sim.core.recording import EPISODES, META, STEPS


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A recording of a game that was played to the end."""
    folder = tmp_path_factory.mktemp("good")
    seats = {"paddle_0": "striker", "paddle_1": "still"}
    match = LiveMatch("duel", seats, {"options": {"seconds": 1.0}}, seed=1)
    session = open_table(match, Recorder(folder))
    match.start()
    for _ in range(5 * RATE):
        session.tick()
    (path,) = folder.iterdir()
    return path


def meta(change):
    """A change of what `meta.json` says."""

    def spoil(path):
        head = json.loads((path / META).read_text())
        change(head)
        (path / META).write_text(json.dumps(head))

    return spoil


def text(words):
    return lambda path: (path / META).write_bytes(words)


def put(name, value):
    return meta(lambda head: head.update({name: value}))


def drop(name):
    return meta(lambda head: head.pop(name))


def column(name, fields):
    return meta(lambda head: head["columns"][name].update(fields))


def steps(change):
    """A change of the bytes of the steps."""

    def spoil(path):
        (part,) = (path / STEPS).iterdir()
        part.write_bytes(change(part.read_bytes()))

    return spoil


def table(change, file="steps"):
    """A change of a table."""

    def spoil(path):
        where = (
            path / EPISODES if file == "episodes" else next((path / STEPS).iterdir())
        )
        pq.write_table(change(pq.read_table(where)), where)

    return spoil


def row(**values):
    """The table of episodes with other values."""

    def change(found):
        return pa.Table.from_pylist([{**found.to_pylist()[0], **values}])

    return table(change, "episodes")


def cut(found):
    return found.drop_columns([found.column_names[-1]])


BAD = {
    "empty meta": text(b""),
    "binary meta": text(b"\x00\xff" * 100),
    "half a meta": text(b'{"format": 1, "scen'),
    "a list": text(b"[1, 2]"),
    "a number": text(b"3"),
    "null": text(b"null"),
    "deep": text(b"[" * 100_000),
    "nan": text(b"NaN"),
    "another thing": text(b'{"title": "holidays"}'),
    "no format": drop("format"),
    "format 0": put("format", 0),
    "format 99": put("format", 99),
    "format text": put("format", "new"),
    "no scenario": drop("scenario"),
    "scenario number": put("scenario", 5),
    "unknown scenario": put("scenario", "chess"),
    "scenario path": put("scenario", "../../etc/passwd"),
    "no columns": drop("columns"),
    "columns list": put("columns", [1]),
    "columns empty": put("columns", {}),
    "dt 0": put("control_dt", 0),
    "dt text": put("control_dt", "fast"),
    "no players": drop("players"),
    "players number": put("players", 7),
    "players texts": put("players", ["a", "b"]),
    "one player": put("players", [{"driver": "a", "person": None}]),
    "handicap text": put("players", [{"driver": "a", "handicap": "gentle"}] * 2),
    "handicap unknown": put("players", [{"driver": "a", "handicap": {"luck": 1}}] * 2),
    "handicap large": put("players", [{"driver": "a", "handicap": {"noise": 9}}] * 2),
    "study text": put("study", "mine"),
    "options text": put("options", "many"),
    "options unknown": put("options", {"gravity": 9.81}),
    "three pucks": put("options", {"pucks": 3}),
    "other shape": column("action", {"shape": [3, 3]}),
    "other kind": column("action", {"dtype": "int8"}),
    "no kind": column("action", {"dtype": "soup"}),
    "steps empty": steps(lambda data: b""),
    "steps half": steps(lambda data: data[: len(data) // 2]),
    "steps noise": steps(lambda data: bytes(np.arange(256, dtype=np.uint8)) * 9),
    "steps flipped": steps(lambda data: data[:900] + b"\xff" * 200 + data[1100:]),
    "a column less": table(cut),
    "steps gone": lambda path: shutil.rmtree(path / STEPS),
    "episodes noise": lambda path: (path / EPISODES).write_bytes(b"PAR1" * 50),
    "episode number": row(episode=5),
    "no reason": row(reason=None),
}


@pytest.fixture(params=BAD)
def bad(request, good, tmp_path):
    path = tmp_path / "bad"
    shutil.copytree(good, path)
    BAD[request.param](path)
    return path


def test_a_report_skips_what_makes_no_sense(bad, good, tmp_path):
    shutil.copytree(good, tmp_path / "good")
    found = summarize(tmp_path)
    assert found.episodes == 1
    (words,) = found.skipped
    assert str(bad) in words
    assert "\n" not in words
    assert words in found.to_markdown()


def words_of_a_page(path):
    try:
        return json.dumps(replay_of(path))  # A page needs less than a report.
    except ValueError as error:
        return str(error)


def test_a_page_shows_it_or_names_what_is_wrong(bad):
    words = words_of_a_page(bad)
    assert words.startswith("{") or str(bad) in words
