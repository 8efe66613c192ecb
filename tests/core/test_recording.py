"""The file format of recordings: what is written is read, what is broken is named."""

import json
import os
import signal
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest

from marl_airhockey.core.recording import (
    FORMAT,
    RecordingWriter,
    read_head,
    read_recording,
)

HEAD = {"scenario": "reach", "control_dt": 0.05}


def columns(steps, start=0.0):
    return {
        "state.position": start + np.arange(steps * 4.0).reshape(steps, 2, 2),
        "success": np.zeros((steps, 1), bool),
        "reward": np.ones((steps, 1), np.float32),
        "count": np.arange(steps, dtype=np.int16),
    }


def first():
    return {name: value[0] for name, value in columns(1).items()}


def write(path, episodes=2, steps=5):
    writer = RecordingWriter(path, HEAD)
    for k in range(episodes):
        writer.begin({"seed": k}, first())
        writer.add_rows(columns(steps, start=k))
        writer.end({"reason": "played to the end"})
    writer.close()
    return path


def test_what_is_written_is_read(tmp_path):
    path = write(tmp_path / "a.rec")
    recording = read_recording(path)
    assert recording.head["scenario"] == "reach"
    assert [e.notes["seed"] for e in recording.episodes] == [0, 1]
    for k, episode in enumerate(recording.episodes):
        assert len(episode) == 5
        assert episode.end["reason"] == "played to the end"
        for name, value in columns(5, start=k).items():
            np.testing.assert_array_equal(episode.columns[name], value)
            assert episode.columns[name].dtype == value.dtype
        assert episode.first["count"].shape == ()
        episode.columns["reward"][0] = 7.0  # It is the caller's own.


def test_steps_one_by_one_are_those_of_a_block(tmp_path):
    whole = columns(400)
    writer = RecordingWriter(tmp_path / "a.rec", HEAD)
    writer.begin({}, first())
    for n in range(400):
        writer.add({name: value[n] for name, value in whole.items()})
        time.sleep(0.003)
    writer.end({})
    writer.close()
    (episode,) = read_recording(tmp_path / "a.rec").episodes
    for name, value in whole.items():
        np.testing.assert_array_equal(episode.columns[name], value)


def test_big_endian_numbers_come_back_the_same(tmp_path):
    writer = RecordingWriter(tmp_path / "a.rec", HEAD)
    writer.begin({}, {"x": np.arange(3.0).astype(">f8")})
    writer.close()
    (episode,) = read_recording(tmp_path / "a.rec").episodes
    np.testing.assert_array_equal(episode.first["x"], np.arange(3.0))


def test_a_file_is_never_overwritten(tmp_path):
    write(tmp_path / "a.rec")
    with pytest.raises(FileExistsError):
        RecordingWriter(tmp_path / "a.rec", HEAD)


def test_wherever_it_is_cut_all_before_is_read(tmp_path):
    """Every byte of a file may be the last one that reached the disk."""
    whole = write(tmp_path / "a.rec", episodes=3, steps=2).read_bytes()
    head = len(whole.splitlines(keepends=True)[0])
    most = 0
    for size in range(head, len(whole) + 1):
        path = tmp_path / "cut.rec"
        path.write_bytes(whole[:size])
        episodes = read_recording(path).episodes
        steps = sum(len(episode) for episode in episodes)
        assert steps >= most
        most = max(steps, most)
        assert sum(bool(episode.end) for episode in episodes) >= steps // 2 - 1
    assert most == 6


def test_kill_9_loses_a_second_at_most(tmp_path):
    path = tmp_path / "a.rec"
    code = f"""
import time, numpy as np
from pathlib import Path
from marl_airhockey.core.recording import RecordingWriter
writer = RecordingWriter(Path({str(path)!r}), {HEAD!r})
writer.begin({{}}, {{"clock": np.array(time.time())}})
while True:
    writer.add({{"clock": np.array(time.time())}})
    time.sleep(0.01)
"""
    with subprocess.Popen([sys.executable, "-c", code]) as process:
        while not path.exists():
            time.sleep(0.01)
        time.sleep(3.0)
        killed = time.time()
        os.kill(process.pid, signal.SIGKILL)
    (episode,) = read_recording(path).episodes
    assert episode.end == {}
    assert killed - episode.columns["clock"][-1] < 1.0


def block(kind, own, data=None, crc=None, **lies):
    """A block as bytes, with as many lies as asked for."""
    body = b"".join(value.tobytes() for value in own.values())
    data = zlib.compress(body) if data is None else data
    layout = [[n, v.dtype.str, list(v.shape)] for n, v in own.items()]
    line = {"kind": kind, "episode": 0, "arrays": layout, "size": len(data)}
    line |= {"crc": zlib.crc32(data) if crc is None else crc, **lies}
    return json.dumps(line).encode() + b"\n" + data + b"\n"


def line(**keys):
    return json.dumps(keys).encode() + b"\n"


NAN = columns(3)
NAN["state.position"][1, 0, 0] = np.nan
START = line(kind="head", format=FORMAT, **HEAD) + block("begin", first())
HUGE = [["x", "<f8", [1_600_000_000]]]
BROKEN = {
    "nothing": (b"", "no recording"),
    "text": (b"hello\n", "no recording"),
    "binary": (b"\xff\x00\x01" * 99, "no recording"),
    "a list": (b"[1, 2]\n", "no recording"),
    "another's": (line(kind="diary", format=1), "no recording"),
    "old": (line(kind="meta", format=2), "an older version"),
    "new": (line(kind="head", format=99, **HEAD), "an other version"),
    "no scenario": (line(kind="head", format=FORMAT, control_dt=0.05), "scenario"),
    "dt 0": (line(kind="head", format=FORMAT, scenario="a", control_dt=0), "dt 0 is"),
    "dt text": (line(kind="head", format=FORMAT, scenario="a", control_dt="x"), "dt"),
    "a list within": (START + b"[1]\n", "no line of a recording at byte"),
    "garbage within": (START + b"\x00\x01\n", "no line of a recording at byte"),
    "no episode": (START + line(kind="steps"), "no line of a recording"),
    "unknown episode": (START + line(kind="end", episode=7), "7 is missing"),
    "flipped bit": (START + block("steps", columns(2), crc=1), "checksum"),
    "not compressed": (START + block("steps", columns(2), data=b"abc"), "damaged"),
    "too few numbers": (
        START + block("steps", columns(2), data=zlib.compress(b"abc")),
        "not as many numbers",
    ),
    "too many numbers": (
        START + block("steps", columns(2), data=zlib.compress(b"a" * 999)),
        "not as many numbers",
    ),
    "12 GiB": (START + block("steps", columns(2), arrays=HUGE), "arrays of 128000000"),
    "a long block": (START + block("steps", columns(2), size=1 << 40), "a block of"),
    "objects": (
        START + block("steps", columns(2), arrays=[["x", "|O", [1]]]),
        "is no array",
    ),
    "negative shape": (
        START + block("steps", columns(2), arrays=[["x", "<f8", [-1, -8]]]),
        "is no array",
    ),
    "rows that differ": (
        START + block("steps", {"a": np.zeros(2), "b": np.zeros(3)}),
        r"columns have \[2, 3\] rows",
    ),
    "columns that change": (
        START + block("steps", columns(2)) + block("steps", {"a": np.zeros(2)}),
        "its columns change",
    ),
    "shapes that change": (
        START
        + block("steps", {"a": np.zeros((2, 3))})
        + block("steps", {"a": np.zeros((2, 4))}),
        "its columns change",
    ),
    "nan": (
        START + block("steps", columns(2)) + block("steps", NAN),
        "state.position is not finite at step 3",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_named(tmp_path, name):
    data, words = BROKEN[name]
    path = tmp_path / "broken.rec"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=rf"broken\.rec: .*{words}"):
        read_recording(path)


def read_or_name(path):
    """Return a recording, or None for one that is refused by its name."""
    try:
        return read_recording(path)
    except ValueError as error:
        if f"{path}: " not in str(error):
            raise
        return None


def test_two_hundred_random_injuries_are_named_or_harmless(tmp_path):
    """No traceback of another kind, and no wrong numbers."""
    whole = write(tmp_path / "a.rec").read_bytes()
    good = read_recording(tmp_path / "a.rec")
    rng = np.random.default_rng(0)
    path = tmp_path / "broken.rec"
    named = 0
    for _ in range(200):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), rng.integers(1, 4)):
            data[at] ^= int(rng.integers(1, 256))
        path.write_bytes(data)
        found = read_or_name(path)
        if found is None:
            named += 1
            continue
        for episode, was in zip(found.episodes, good.episodes, strict=False):
            for key, value in episode.columns.items():
                if key in was.columns:
                    np.testing.assert_array_equal(value, was.columns[key][: len(value)])
    assert named > 100


def test_a_missing_file_and_its_head_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"no\.rec: cannot be read"):
        read_recording(tmp_path / "no.rec")
    with pytest.raises(ValueError, match="cannot be read"):
        read_head(tmp_path)
    assert read_head(write(tmp_path / "a.rec"))["control_dt"] == 0.05
