"""Recordings of the former version are converted; damaged ones are named."""

import json
import zlib

import numpy as np
import pytest

from marl_airhockey.data.format_3 import convert
from marl_airhockey.data.reader import read_recording

pytest.importorskip("pyarrow")
ROWS = {"state.time": np.arange(4.0), "reward": np.ones((4, 1), np.float32)}


def block(kind, arrays=None, **notes):
    line, data = {"kind": kind, "episode": 0, **notes}, b""
    if arrays is not None:
        data = zlib.compress(b"".join(value.tobytes() for value in arrays.values()))
        line["arrays"] = [[n, v.dtype.str, list(v.shape)] for n, v in arrays.items()]
        line |= {"size": len(data), "crc": zlib.crc32(data)}
        data += b"\n"
    return json.dumps(line).encode() + b"\n" + data


HEAD = {"kind": "head", "format": 3, "scenario": "reach", "control_dt": 0.05}
FILE = (
    json.dumps(HEAD).encode()
    + b"\n"
    + block("begin", {"state.time": np.array(0.0)}, seed=7, physics={"tilt": 5.5})
    + block("steps", ROWS)
    + block("end", reason="played to the end", steps=4)
)


def test_a_file_becomes_a_recording(tmp_path):
    (tmp_path / "old.rec").write_bytes(FILE)
    path = convert(tmp_path / "old.rec", tmp_path / "new")
    assert path == tmp_path / "new" / "old"
    (episode,) = read_recording(path).episodes
    assert (episode.seed, episode.physics) == (7, {"tilt": 5.5})
    assert episode.reason == "played to the end"
    for name, value in ROWS.items():
        np.testing.assert_array_equal(episode.columns[name], value)
    with pytest.raises(ValueError, match="there is such a folder"):
        convert(tmp_path / "old.rec", tmp_path / "new")


def test_what_was_cut_off_is_kept_as_far_as_it_goes(tmp_path):
    (tmp_path / "old.rec").write_bytes(FILE[:-30])
    (episode,) = read_recording(
        convert(tmp_path / "old.rec", tmp_path / "new")
    ).episodes
    assert (len(episode), episode.reason) == (4, "")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"hello\n", "Expecting value"),
        (b'{"kind": "meta", "format": 2}\n', "no recording of format 3"),
        (FILE.replace(b'"size": ', b'"size": 1'), "checksum|block"),
        (FILE[:-30] + b"[1]\n", "no line of a recording at byte"),
    ],
)
def test_what_is_damaged_is_named(tmp_path, data, words):
    (tmp_path / "old.rec").write_bytes(data)
    with pytest.raises(ValueError, match=rf"old\.rec: .*({words})"):
        convert(tmp_path / "old.rec", tmp_path / "new")
    assert not (tmp_path / "new" / "old").exists()
