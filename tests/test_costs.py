"""The rule on CPU-seconds of tests can fail, and its list of reasons is of today."""

from pathlib import Path
from types import SimpleNamespace

import costs
import pytest

ROOT = Path(__file__).parents[1]
KNOWN = "tests/test_a.py::test_known"


@pytest.fixture
def summary(monkeypatch):
    monkeypatch.setattr(costs, "EXPENSIVE", {KNOWN: "a reason"})
    return costs.Summary(SimpleNamespace())


def report(summary, name, cost, when="call", **change):
    known = {"slow": False, "compiled": False, "passed": True, **change}
    summary.pytest_runtest_logreport(
        SimpleNamespace(costs=[(name, cost)], when=when, **known)
    )


def test_a_test_that_costs_too_much_fails_the_run(summary):
    report(summary, "tests/test_a.py::test_dear", 7.0, when="setup")
    report(summary, "tests/test_a.py::test_cheap", 11.9)
    assert not list(summary.faults())
    report(summary, "tests/test_a.py::test_dear", 7.0)
    (fault,) = summary.faults()
    assert fault.startswith("tests/test_a.py::test_dear costs 14.0 CPU-s of 12")
    session = SimpleNamespace(exitstatus=0)
    summary.pytest_sessionfinish(session)
    assert session.exitstatus == pytest.ExitCode.TESTS_FAILED


@pytest.mark.parametrize(
    "change", [{"slow": True}, {"compiled": True}, {"passed": False}]
)
def test_slow_failed_and_compiling_tests_are_not_judged(summary, change):
    report(summary, "tests/test_a.py::test_dear", 50.0, **change)
    report(summary, "tests/test_a.py::test_late", 50.0, when="teardown")
    assert not list(summary.faults())


def test_a_reason_serves_while_it_is_needed(summary):
    report(summary, KNOWN, 9.0)
    assert not list(summary.faults())
    other = costs.Summary(SimpleNamespace())
    report(other, KNOWN, 1.0)
    assert list(other.faults()) == [
        f"{KNOWN} costs 1.0 CPU-s: EXPENSIVE need not name it"
    ]


def test_reasons_name_tests_that_exist():
    for name in costs.EXPENSIVE:
        path, _, test = name.partition("::")
        assert f"def {test.partition('[')[0]}(" in (ROOT / path).read_text()
