"""Trials: plans, sheets that go on after a cut, and the intervals of comparisons."""

import json
from collections import Counter

import numpy as np
import pytest
from typer.testing import CliRunner

from marl_airhockey.build import build_driven_world
from marl_airhockey.cli.main import app
from marl_airhockey.evaluation.comparison import Outcomes, compare
from marl_airhockey.evaluation.trial_sheet import TrialRow, TrialSheet, plan_trials
from marl_airhockey.evaluation.trials import play_trials, spread, spread_starts
from marl_airhockey.registry import make_driver

METHODS = {"new": ["sticky", "random"], "old": ["still"]}


def plan(trials=6, starts=(5, 7, 9)):
    return plan_trials("juggle", METHODS, starts, trials, {"backend": "numba"})


def drivers():
    return {name: [make_driver(p) for p in paths] for name, paths in METHODS.items()}


def one_world():
    return build_driven_world(make_driver("still"), "juggle", 1, {})


def test_every_method_plays_from_every_start_equally_often():
    found = plan(12)
    count = Counter((start, name) for start, name, _ in found.trials)
    assert set(count.values()) == {4}
    assert len(count) == 6
    by_policy = Counter(k for _, name, k in found.trials if name == "new")
    assert by_policy == {0: 6, 1: 6}
    # Both methods play within each round, in an order that differs.
    rounds = [[t[1] for t in found.trials[2 * k :][:2]] for k in range(12)]
    assert all(sorted(names) == ["new", "old"] for names in rounds)
    assert {names[0] for names in rounds} == {"new", "old"}
    assert sorted(found.codes.values()) == ["A", "B"]


def test_all_trials_are_played_from_the_start_they_name(tmp_path):
    world, sheet = one_world(), TrialSheet(tmp_path, plan())
    own = world.driven[0]
    play_trials(world, sheet, drivers())
    assert world.driven[0] is own
    assert [row.trial for row in sheet.rows] == list(range(12))
    still = [row for row in sheet.rows if row.code == sheet.plan.codes["old"]]
    returns = {row.start: row.returns for row in still}
    # Who rests does the same from the same start.
    assert all(row.returns == returns[row.start] for row in still)
    assert len(returns) == 3


def test_a_sheet_that_was_cut_goes_on(tmp_path):
    whole = TrialSheet(tmp_path / "whole", plan())
    play_trials(one_world(), whole, drivers())
    play_trials(one_world(), TrialSheet(tmp_path / "cut", plan()), drivers())
    rows = tmp_path / "cut" / "trials.csv"
    lines = rows.read_text().splitlines()
    rows.write_text("\n".join(lines[:5]) + "\n" + lines[5][:9])
    sheet = TrialSheet(tmp_path / "cut", plan())
    assert len(sheet.rows) == 4
    play_trials(one_world(), sheet, drivers())

    def played(found):
        return [(row.trial, row.code, row.start, row.returns) for row in found.rows]

    assert played(sheet) == played(whole)
    assert played(TrialSheet(tmp_path / "cut", plan())) == played(whole)


def test_a_folder_of_another_plan_is_refused(tmp_path):
    TrialSheet(tmp_path, plan())
    with pytest.raises(ValueError, match="another plan"):
        TrialSheet(tmp_path, plan(7))


def test_a_broken_row_is_named(tmp_path):
    sheet = TrialSheet(tmp_path, plan())
    rows = tmp_path / "trials.csv"
    rows.write_text(rows.read_text() + "0,0,A,0,much,0,0,0,,,\n")
    with pytest.raises(ValueError, match=r"trials\.csv: row"):
        TrialSheet(tmp_path, sheet.plan)


def test_starts_are_spread_and_each_is_there_once():
    seeds = spread_starts(one_world(), 16)
    assert len(set(seeds)) == 16

    def places(seeds):
        world = build_driven_world(make_driver("still"), "juggle", len(seeds), {})
        world.reset(seeds)
        return world.state.puck[:, 0]

    def closest(points):
        gaps = np.linalg.norm(points[:, None] - points, axis=-1)
        return np.sort(gaps + np.eye(len(points)), 1)[:, 0].mean()

    drawn = [closest(places(range(s, s + 16))) for s in range(0, 640, 16)]
    assert closest(places(seeds)) > np.mean(drawn)


def test_starts_that_are_all_alike_are_taken_too():
    points = np.zeros((40, 3))
    assert len(set(spread(points, 5))) == 5
    points[:30] = 1.0
    assert len(set(spread(points, 5))) == 5


def outcomes(rng, means, trials):
    policy = np.repeat(np.arange(len(means)), trials)
    success = (rng.random(len(policy)) < np.repeat(means, trials)).astype(float)
    return Outcomes(policy, success, success * 2, np.zeros(len(policy)))


def test_intervals_hold_the_true_difference_about_as_often_as_they_say(monkeypatch):
    monkeypatch.setattr("marl_airhockey.evaluation.comparison.RESAMPLES", 400)
    rng = np.random.default_rng(0)
    held = 0
    for k in range(100):
        a, b = (np.clip(rng.normal(m, 0.1, 5), 0, 1) for m in (0.6, 0.5))
        found = compare({"a": outcomes(rng, a, 10), "b": outcomes(rng, b, 10)}, k)
        low, high = found.differences[0].success_interval
        held += low <= 0.1 <= high
    assert 88 <= held <= 100


def test_several_policies_make_an_interval_wider_than_their_trials_alone():
    rng = np.random.default_rng(1)
    many = outcomes(rng, [0.1, 0.9, 0.2, 0.8, 0.5], 20)
    alone = Outcomes(np.zeros(100), many.success, many.returns, many.interrupted)
    found = compare({"many": many, "alone": alone})
    wide, narrow = (np.ptp(method.returns_interval) for method in found.methods)
    assert wide > 2 * narrow
    assert (found.methods[0].policies, found.methods[1].policies) == (5, 1)


def test_trials_that_all_succeed_leave_something_open():
    sure = Outcomes(np.repeat(np.arange(5), 4), np.ones(20), np.ones(20), np.zeros(20))
    found = compare({"a": sure, "b": sure})
    low, high = found.methods[0].success_interval
    assert low < 0.85
    assert high == 1.0
    low, high = found.differences[0].success_interval
    assert low < -0.1
    assert high > 0.1


def test_a_trial_that_was_ended_by_the_table_is_counted():
    rows = Outcomes(np.zeros(4), np.array([1.0, 0, 1, 0]), np.zeros(4), np.eye(4)[1])
    assert compare({"a": rows}).methods[0].interrupted == 1


def test_the_command_plays_compares_and_goes_on(tmp_path):
    command = ["trials", "still", "new=sticky", "new=random", "-s", "touch"]
    command += ["--trials", "4", "--starts", "2", "--out", str(tmp_path), "--json"]
    first = CliRunner().invoke(app, command)
    assert first.exit_code == 0, first.output
    found = json.loads((tmp_path / "result.json").read_text())
    assert [(m["name"], m["trials"]) for m in found["methods"]] == [
        ("still", 4),
        ("new", 4),
    ]
    rows = (tmp_path / "trials.csv").read_text()
    assert "still" not in rows
    assert len(rows.splitlines()) == 9
    assert len((tmp_path / "starts.csv").read_text().splitlines()) == 3
    CliRunner().invoke(app, command)
    assert (tmp_path / "trials.csv").read_text() == rows


def test_a_policy_that_is_there_twice_is_named():
    with pytest.raises(ValueError, match="a=still: this policy is given twice"):
        CliRunner().invoke(
            app, ["trials", "a=still", "a=still"], catch_exceptions=False
        )


def test_rows_come_back_as_they_were_written(tmp_path):
    sheet = TrialSheet(tmp_path, plan())
    row = TrialRow(0, 1, "A", 0, 1, 0.1 + 0.2, 1.25, 2.0, "x", "y", 'a, "b"')
    sheet.add(row)
    assert TrialSheet(tmp_path, sheet.plan).rows == [row]
