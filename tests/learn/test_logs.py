"""Logs of a run."""

import csv

import pytest

pytest.importorskip("tensorboard")

from marl_airhockey.learn.logs import RunLog


def test_a_log_has_a_row_for_each_dump_and_a_column_for_each_name(tmp_path):
    log = RunLog(tmp_path, 0)
    log.record("rate", 0.5)
    log.record_mean("reward", 1.0)
    log.record_mean("reward", 2.0)
    log.dump(64)
    log.record("rate", 0.25)
    log.record("success", 1.0)
    log.dump(128)
    log.record("rate", 0.125)
    log.dump(192)
    log.close()
    with (tmp_path / "progress.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = ("steps", "rate", "reward", "success")
    assert [[row[name] for name in names] for row in rows] == [
        ["64", "0.5", "1.5", ""],
        ["128", "0.25", "", "1.0"],
        ["192", "0.125", "", ""],
    ]
    assert list(tmp_path.glob("*tfevents*"))


def test_a_resumed_run_begins_another_file(tmp_path):
    log = RunLog(tmp_path, 64)
    log.record("rate", 0.5)
    log.dump(128)
    log.close()
    assert (tmp_path / "progress-64.csv").exists()
