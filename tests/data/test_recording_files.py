"""Recordings on the disk: what is written is read, what is broken is named."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from unittest.mock import patch

import numpy as np
import pytest

from marl_airhockey.data import writer
from marl_airhockey.data.derived import repaired
from marl_airhockey.data.files import whole_recordings_in
from marl_airhockey.data.parts import merge_parts, parts_of
from marl_airhockey.data.reader import (
    episodes_of,
    missing_steps,
    read_head,
    read_recording,
)
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.writer import PART, RecordingWriter
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.recording import FORMAT

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
HEAD = {"scenario": "reach", "control_dt": 0.05}


def columns(steps, start=0.0):
    return {
        "state.position": start + np.arange(steps * 4.0).reshape(steps, 2, 2),
        "empty": np.zeros((steps, 0, 2)),
        "success": np.arange(steps).reshape(steps, 1) % 2 > 0,
        "reward": np.ones((steps, 1), np.float32),
        "count": np.arange(steps, dtype=np.int16),
    }


def first():
    kept = columns(1)
    del kept["reward"]
    return {name: value[0] for name, value in kept.items()}


def write(path, episodes=2, steps=5, flush=False):
    """Write a recording, with ``flush`` in a part for each episode."""
    size = steps + 1 if flush else PART
    with patch.object(writer, "PART", size), RecordingWriter(path, HEAD) as file:
        for k in range(episodes):
            file.begin(first(), seed=k, physics={"tilt": 5.0 + k})
            file.add_rows(columns(steps, start=k))
            file.end("played to the end")
    return path


def test_what_is_written_is_read(tmp_path):
    recording = read_recording(write(tmp_path / "a"))
    assert recording.head["scenario"] == "reach"
    assert [e.seed for e in recording.episodes] == [0, 1]
    for k, episode in enumerate(recording.episodes):
        assert len(episode) == 5
        assert episode.physics == {"tilt": 5.0 + k}
        assert episode.reason == "played to the end"
        for name, value in columns(5, start=k).items():
            np.testing.assert_array_equal(episode.columns[name], value)
            assert episode.columns[name].dtype == value.dtype
        assert episode.first["count"].shape == ()
        np.testing.assert_array_equal(episode.first["state.position"], [[0, 1], [2, 3]])
        assert np.isnan(episode.first["reward"]).all()
        episode.columns["reward"][0] = 7.0  # It is the caller's own.


def test_pandas_alone_reads_it(tmp_path):
    pandas = pytest.importorskip("pandas")
    write(tmp_path / "a", flush=True)
    steps = pandas.read_parquet(tmp_path / "a" / "steps")
    shape = json.loads((tmp_path / "a" / "meta.json").read_text())["columns"]
    steps = steps[steps.step > 0]
    place = np.stack(steps["state.position"]).reshape(
        -1, *shape["state.position"]["shape"]
    )
    assert len(steps) == 10
    np.testing.assert_array_equal(place[5:], columns(5, 1)["state.position"])
    assert shape["state.position"]["unit"] == "m"
    episodes = pandas.read_parquet(tmp_path / "a" / "episodes.parquet")
    assert episodes["length"].tolist() == [5, 5]
    assert episodes["physics.tilt"].tolist() == [5.0, 6.0]


def test_steps_one_by_one_are_those_of_a_block(tmp_path):
    whole = columns(400)
    with RecordingWriter(tmp_path / "a", HEAD) as file:
        file.begin(first())
        for n in range(400):
            file.add({name: value[n] for name, value in whole.items()})
            time.sleep(0.003)
        file.end("over")
        assert len(parts_of(tmp_path / "a")) > 1
    # Closing merges what was written every half second.
    assert len(parts_of(tmp_path / "a")) == 1
    (episode,) = read_recording(tmp_path / "a").episodes
    for name, value in whole.items():
        np.testing.assert_array_equal(episode.columns[name], value)
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == [
        "episodes.parquet",
        "meta.json",
        "steps",
    ]


def test_a_recording_is_never_overwritten(tmp_path):
    write(tmp_path / "a")
    with pytest.raises(FileExistsError):
        RecordingWriter(tmp_path / "a", HEAD)


def test_the_largest_seed_is_kept(tmp_path):
    with RecordingWriter(tmp_path / "a", HEAD) as file:
        file.begin(first(), seed=2**64 - 1)
        file.add_rows(columns(2))
        file.end("over")
    (episode,) = read_recording(tmp_path / "a").episodes
    assert episode.seed == 2**64 - 1


def test_after_an_error_there_is_no_recording(tmp_path):
    with pytest.raises(ValueError, match="rows"):
        write_wrong(tmp_path / "a")
    assert not (tmp_path / "a").exists()
    with whole(tmp_path / "a") as file:
        file.begin(first())
    with (
        pytest.raises(ValueError, match="the folder exists"),
        whole(tmp_path / "a"),
    ):
        pass


def write_wrong(path):
    with whole(path) as file:
        file.begin(first())
        file.add_rows({"count": np.zeros(2), "reward": np.zeros(3)})


def whole(path):
    return writer.whole_recording(path, HEAD)


def test_two_writers_do_not_share_a_folder(tmp_path):
    with RecordingWriter(tmp_path / "a", HEAD) as file:
        file.begin(first())
        with pytest.raises(RuntimeError, match="another process writes it"):
            RecordingWriter.extend(tmp_path / "a", read_head(tmp_path / "a"), [])


def test_columns_that_change_are_refused(tmp_path):
    with RecordingWriter(tmp_path / "a", HEAD) as file:
        file.begin(first())
        file.add_rows(columns(2))
        with pytest.raises(ValueError, match="columns extra: expected the same"):
            file.add_rows({**columns(2), "extra": np.zeros(2)})
        with pytest.raises(ValueError, match="count: shape"):
            file.add_rows({**columns(2), "count": np.zeros((2, 3))})
        with pytest.raises(ValueError, match="rows"):
            file.add_rows({**columns(2), "count": np.zeros(3)})
    (episode,) = read_recording(tmp_path / "a").episodes
    assert len(episode) == 2


def test_a_full_disk_is_named_and_loses_nothing(tmp_path, monkeypatch):
    path = write(tmp_path / "a", flush=True)
    rows = read_recording(path).episodes
    real = pq.write_table

    def full(table, file, **keywords):
        file.write(b"PAR1")
        raise OSError(28, "No space left on device")

    file = RecordingWriter.extend(path, read_head(path), episode_rows(path))
    file.begin(first())
    file.add_rows(columns(3))
    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(OSError, match=r"No space left on device.*/a/episodes"):
        file.flush()
    monkeypatch.setattr(pq, "write_table", real)
    assert not list(path.rglob("*.part"))
    assert len(read_recording(path).episodes) == len(rows)
    file.end("over")
    file.close()  # There is room again.
    assert len(read_recording(path).episodes) == len(rows) + 1


def episode_rows(path):
    return pq.ParquetFile(path / "episodes.parquet").read().to_pylist()


def test_a_merge_that_was_cut_off_repeats_nothing(tmp_path):
    path = write(tmp_path / "a", episodes=4, flush=True)
    good = read_recording(path)
    later = [(part, part.read_bytes()) for part in parts_of(path)[1:]]
    merge_parts(path)
    for part, data in later:
        part.write_bytes(data)
        again = read_recording(path)
        assert [len(e) for e in again.episodes] == [len(e) for e in good.episodes]


def test_kill_9_loses_a_second_at_most(tmp_path):
    path = tmp_path / "a"
    code = f"""
import time, numpy as np
from pathlib import Path
from marl_airhockey.data.writer import RecordingWriter
writer = RecordingWriter(Path({str(path)!r}), {HEAD!r})
writer.begin({{"clock": np.array(time.time())}}, seed=3)
while True:
    writer.add({{"clock": np.array(time.time())}})
    time.sleep(0.01)
"""
    with subprocess.Popen([sys.executable, "-c", code]) as process:
        while not (path / "episodes.parquet").exists():
            time.sleep(0.01)
        time.sleep(3.0)
        killed = time.time()
        os.kill(process.pid, signal.SIGKILL)
    (episode,) = read_recording(path).episodes
    assert episode.reason == ""
    assert episode.seed == 3
    assert killed - episode.columns["clock"][-1] < 1.0


def change_meta(**changes):
    def injure(path):
        meta = path / "meta.json"
        meta.write_text(json.dumps({**json.loads(meta.read_text()), **changes}))

    return injure


def change_part(change):
    def injure(path):
        part = parts_of(path)[1]
        pq.write_table(change(pq.ParquetFile(part).read()), part)

    return injure


def replaced(name, values):
    def change(table):
        return table.set_column(table.column_names.index(name), name, values(table))

    return change_part(change)


def cut(name, share):
    def injure(path):
        file = path / name
        file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])

    return injure


def flat(table, name):
    values = table[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
    return values.copy()


def with_nan(table):
    values = flat(table, "state.position")
    values[9] = np.nan
    return pa.FixedSizeListArray.from_arrays(pa.array(values), 4)


def fewer_numbers(table):
    values = flat(table, "state.position")[: 2 * len(table)]
    return pa.FixedSizeListArray.from_arrays(pa.array(values), 2)


def remove(name):
    return lambda path: (path / name).unlink()


def text(name, words):
    return lambda path: (path / name).write_text(words)


SECOND = "steps/part-00001.parquet"
BROKEN = {
    "no meta": (remove("meta.json"), "cannot be read"),
    "empty meta": (text("meta.json", ""), "not a recording"),
    "text": (text("meta.json", "hello"), "not a recording"),
    "binary": (lambda p: (p / "meta.json").write_bytes(b"\xff\0"), "not a recording"),
    "a list": (text("meta.json", "[1, 2]"), "not a recording"),
    "another's": (text("meta.json", '{"kind": "diary"}'), "not a recording"),
    "old": (change_meta(format=3), "another version"),
    "new": (change_meta(format=99), "another version"),
    "no scenario": (change_meta(scenario=None), "scenario"),
    "dt 0": (change_meta(control_dt=0), "dt 0; expected"),
    "dt text": (change_meta(control_dt="x"), "dt 'x'; expected"),
    "no columns": (change_meta(columns=None), "columns"),
    "odd columns": (change_meta(columns={"x": 3}), "column x: 3"),
    "objects": (
        change_meta(columns={"x": {"dtype": "object", "shape": []}}),
        "column x: object",
    ),
    "negative shape": (
        change_meta(columns={"x": {"dtype": "float64", "shape": [-1]}}),
        "column x",
    ),
    "unknown column": (
        change_meta(columns={"x": {"dtype": "float64", "shape": []}}),
        "column x is missing",
    ),
    "cut part": (cut(SECOND, 0.6), "part-00001"),
    "empty part": (cut(SECOND, 0.0), "part-00001"),
    "no parquet": (text(SECOND, "PAR1 hello PAR1"), "part-00001"),
    "cut episodes": (cut("episodes.parquet", 0.5), r"episodes\.parquet"),
    "missing part": (remove(SECOND), "episode 1: its steps are missing"),
    "nan": (replaced("state.position", with_nan), "not finite at step 2"),
    "other shape": (replaced("state.position", fewer_numbers), "expected 4 of float"),
    "other type": (
        replaced("count", lambda t: pa.array(np.zeros(len(t)))),
        "count: 1 numbers of float64",
    ),
    "nulls": (
        replaced("count", lambda t: pa.array([None] * len(t), pa.int16())),
        "column count",
    ),
    "texts": (replaced("count", lambda t: pa.array(["a"] * len(t))), "column count"),
    "unknown episode": (
        replaced("episode", lambda t: pa.array(np.full(len(t), 9, np.int32))),
        "episode 1: its steps are missing",
    ),
    "forgotten episodes": (
        lambda path: pq.write_table(
            pq.ParquetFile(path / "episodes.parquet").read().slice(0, 1),
            path / "episodes.parquet",
        ),
        "episode 1: it is missing in episodes.parquet",
    ),
    "episodes out of order": (
        lambda path: pq.write_table(
            pq.ParquetFile(path / "episodes.parquet").read().slice(1),
            path / "episodes.parquet",
        ),
        "row 0 is not episode 0",
    ),
    "steps that jump": (
        replaced("step", lambda t: pa.array(np.arange(len(t), dtype=np.int32) * 2)),
        "not consecutive",
    ),
}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write(tmp_path_factory.mktemp("good") / "a", episodes=3, flush=True)


@pytest.fixture
def broken(good, tmp_path):
    shutil.copytree(good, tmp_path / "broken")
    return tmp_path / "broken"


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_named(broken, name):
    injure, words = BROKEN[name]
    injure(broken)
    with pytest.raises(ValueError, match=f"{broken}.*{words}"):
        read_recording(broken)


def test_a_part_that_lacks_in_the_middle_of_an_episode_is_named(tmp_path):
    size = patch.object(writer, "PART", 4)
    with size, RecordingWriter(tmp_path / "a", HEAD) as file:
        file.begin(first())
        for k in range(3):
            file.add_rows(columns(4, start=k))
        file.end("over")
    (tmp_path / "a" / SECOND).unlink()
    with pytest.raises(ValueError, match="episode 0: steps 5 to 8 are missing"):
        read_recording(tmp_path / "a")


def test_what_was_cut_off_at_the_end_is_no_fault(tmp_path):
    path = write(tmp_path / "a", episodes=3, flush=True)
    parts_of(path)[-1].unlink()
    assert [e.index for e in episodes_of(path)] == [0, 1]


def test_good_episodes_of_a_broken_recording_are_kept(broken, tmp_path):
    BROKEN["nan"][0](broken)
    wrong = repaired(broken, tmp_path / "new")
    assert len(wrong) == 1
    assert "not finite" in wrong[0]
    kept = read_recording(tmp_path / "new").episodes
    assert [e.seed for e in kept] == [0, 2]
    assert [e.index for e in kept] == [0, 1]


def read_or_name(path):
    """Return a recording, or None for one that is refused by its name."""
    try:
        return read_recording(path)
    except ValueError as error:
        if str(path) not in str(error):
            raise
        return None


def test_random_injuries_are_named_or_harmless(good, tmp_path):
    """200 flips of bytes: no traceback of another kind, and no wrong numbers."""
    known = read_recording(good).episodes
    files = sorted(p for p in good.rglob("*") if p.is_file())
    rng = np.random.default_rng(0)
    named = 0
    for k in range(200):
        path = tmp_path / str(k)
        shutil.copytree(good, path)
        file = path / files[rng.integers(len(files))].relative_to(good)
        data = bytearray(file.read_bytes())
        for at in rng.integers(0, len(data), rng.integers(1, 4)):
            data[at] ^= int(rng.integers(1, 256))
        file.write_bytes(data)
        found = read_or_name(path)
        if found is None:
            named += 1
            continue
        for episode, was in zip(found.episodes, known, strict=False):
            for key, value in episode.columns.items():
                if key in was.columns and file.name != "meta.json":
                    np.testing.assert_array_equal(value, was.columns[key])
    assert named > 100


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(ValueError, match="no: cannot be read as a recording"):
        read_recording(tmp_path / "no")
    assert read_head(write(tmp_path / "a"))["format"] == FORMAT


def test_steps_that_lack_at_the_end_are_named(tmp_path):
    path = record_episodes(
        make_driver("still"), "still", "reach", 3, tmp_path / "a", 0, {}
    )
    (part,) = path.glob("steps/*.parquet")
    table = pq.read_table(part)
    assert missing_steps(path) == {}
    last = table.num_rows - 40
    pq.write_table(table.slice(0, last), part)
    (words,) = missing_steps(path).values()
    assert words == f"{path}: episode 2: 40 of its 60 steps are missing at the end"
    assert read_recording(path).episodes[2].reason == ""
    with pytest.raises(ValueError, match=r"missing in 1 episodes; .* data repair"):
        whole_recordings_in([path])
    assert repaired(path, tmp_path / "good") == [words]
    assert len(read_recording(tmp_path / "good").episodes) == 2
    part.unlink()
    assert list(missing_steps(path)) == [0, 1, 2]
