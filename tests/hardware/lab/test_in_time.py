"""Nothing slow between the steps of a real table: recording, first calls."""

import logging
import subprocess
import sys
import time

import numpy as np
import pyarrow.parquet as pq
import pytest
from emulators import until

import marl_airhockey as ah
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.hardware.table.backend import RealBackend
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.recording import PLAYED

EPISODES = 3
LATE = 0.02
"""s"""


@pytest.fixture
def taken(monkeypatch):
    """Times between the end of a step and the next command, s, as they come."""
    found, own = [], RealBackend._report_lateness

    def report(self, began):
        found.append(began - self._moment)
        own(self, began)

    monkeypatch.setattr(RealBackend, "_report_lateness", report)
    return found


@pytest.mark.slow
def test_a_recording_makes_no_command_late(rig, taken, tmp_path):
    """The largest delay of each episode, the first among them, in the median."""
    keywords = {"backend": "real", "rig": str(rig), "options": {"table": "full_size"}}
    longest, begun = [], [0]

    def ended(done):
        if done:
            longest.append(max(taken[begun[0] :]))
            begun[0] = len(taken)

    record_episodes(
        *(make_driver("zoo/reach_full_size"), "reach", "reach", EPISODES),
        *(tmp_path / "new", 1, keywords, True),
        ended,
    )
    episodes = read_recording(tmp_path / "new").episodes
    assert [episode.reason for episode in episodes] == [PLAYED] * EPISODES
    assert np.median(longest) < LATE


@pytest.mark.slow
def test_a_killed_recording_loses_less_than_a_second(rig, tmp_path):
    path = tmp_path / "killed"
    words = ("data", "record", "still", "-s", "reach", "--backend", "real", "--rig")
    command = [sys.executable, "-m", "marl_airhockey.cli", *words, str(rig)]
    command += ["--option", "table=full_size", "--episodes", "5", "--out", str(path)]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL) as recorder:
        assert until(lambda: any((path / "steps").glob("*")), 60.0)
        time.sleep(1.5)
        seen = steps_in(path)
        recorder.kill()
    # Its driver brakes and ends.
    time.sleep(2.0)
    # The first part is written after half a second, so about 40 steps were made.
    assert seen >= 20


def steps_in(path):
    """Return the number of steps of a recording that is being written."""
    return sum(
        pq.read_metadata(part).num_rows for part in (path / "steps").glob("part-*")
    )


def test_late_commands_end_no_episode_and_are_logged(rig, caplog):
    keywords = {"backend": "real", "rig": str(rig), "options": {"table": "full_size"}}
    env = ah.parallel_env("reach", **keywords)
    env.reset(seed=0)
    with caplog.at_level(logging.WARNING, "marl_airhockey.real"):
        for k in range(12):
            _, _, _, truncated, infos = env.step({"paddle_0": np.array([0.0, 0.2])})
            assert not truncated["paddle_0"], infos
            if k == 5:
                time.sleep(0.4)
    env.close()
    words = [record.getMessage() for record in caplog.records]
    assert any("recording took 4" in text for text in words), words
