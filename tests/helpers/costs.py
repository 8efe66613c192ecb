"""CPU-seconds of every test: what the short run may cost, and its closing line.

A test of the short run above `MOST` CPU-seconds fails the run, unless `EXPENSIVE` gives
a reason. A test during which code is compiled is not judged, as that happens once per
machine. Fixtures that tests share are counted separately. Wall time is never judged.
"""

import json
import resource
import time
from collections import Counter
from pathlib import Path

import pytest

from marl_airhockey.sim.jit.folders import code_folder

MOST = 12.0
"""CPU-seconds of a test without the mark `slow`; on the same machine, the same work
takes up to half as long again if its neighbours are busy"""
ENOUGH = 3.0
"""CPU-seconds below which a test of `EXPENSIVE` needs no reason"""
EXPENSIVE = {
    "tests/learn/test_rllib.py::test_it_learns_and_its_policy_drives_without_ray": (
        "Ray starts processes of its own"
    ),
}
"""Reasons of tests, by their ids, that cost more and belong to the short run"""
FORMER = "marl_airhockey/costs"
"""Where the cache of pytest keeps the costs of the first half of `make test`"""


def cpu_seconds():
    """Return the CPU-seconds of this process and of its ended children."""
    own = resource.getrusage(resource.RUSAGE_SELF)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime


def compilations():
    """Return a number that changes when any process compiles something."""
    return code_folder().stat().st_mtime_ns


class Measure:
    """Plugin of each worker: writes the cost of a phase into its report."""

    def __init__(self):
        self._last, self._before, self._shared = 0.0, 0, []

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef, request):
        before, inside = cpu_seconds(), sum(cost for _, cost in self._shared)
        result = yield
        if fixturedef.scope != "function":
            other = sum(cost for _, cost in self._shared) - inside
            cost = cpu_seconds() - before - other
            self._shared.append((f"fixture {fixturedef.argname}", cost))
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        self._last, self._before = cpu_seconds(), compilations()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item):
        report, now = (yield), cpu_seconds()
        shared, self._shared = self._shared, []
        cost = now - self._last - sum(cost for _, cost in shared)
        report.costs = [(item.nodeid, cost), *shared]
        report.slow = item.get_closest_marker("slow") is not None
        report.compiled = compilations() != self._before
        self._last = now
        return report


class Summary:
    """Plugin of the process that reports: sums costs up and judges them."""

    def __init__(self, config):
        self._config, self._began = config, time.monotonic()
        self._costs, self._exempt = Counter(), set()

    def pytest_runtest_logreport(self, report):
        """Add the cost of a phase; teardowns of shared fixtures belong to no test."""
        for name, cost in getattr(report, "costs", ()):
            if report.when != "teardown":
                self._costs[name] += cost
            if report.slow or report.compiled or not report.passed:
                self._exempt.add(name)

    def faults(self):
        """Return what is wrong with the costs of what has passed and is not slow."""
        for name in self._costs.keys() - self._exempt:
            cost, spent = self._costs[name], f"{self._costs[name]:.1f} CPU-s"
            if cost > MOST and name not in EXPENSIVE:
                yield (
                    f"{name} costs {spent} of {MOST:.0f}: make it cheaper, mark it "
                    "slow, or give a reason in EXPENSIVE (tests/helpers/costs.py)"
                )
            if cost < ENOUGH and name in EXPENSIVE:
                yield f"{name} costs {spent}: EXPENSIVE need not name it"

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session):
        """Fail the run if something costs too much."""
        if not session.exitstatus and any(self.faults()):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        """Write what is wrong, and a file of all costs on request."""
        for fault in self.faults():
            terminalreporter.write_line(f"FAILED {fault}", red=True)
        if path := self._config.getoption("--costs"):
            Path(path).write_text(json.dumps(dict(self._costs.most_common()), indent=1))

    def pytest_unconfigure(self, config):
        """Print the last line: tests, seconds and the five slowest."""
        if not self._costs:
            return
        tests = len([name for name in self._costs if "::" in name])
        seconds, costs = time.monotonic() - self._began, self._costs
        if config.getoption("--closing"):
            before = config.cache.get(FORMER, {"tests": 0, "seconds": 0, "costs": {}})
            tests, seconds = tests + before["tests"], seconds + before["seconds"]
            costs = costs + Counter(before["costs"])
        else:
            known = dict(costs.most_common(5))
            config.cache.set(
                FORMER, {"tests": tests, "seconds": seconds, "costs": known}
            )
        slowest = ", ".join(
            f"{name.removeprefix('tests/')} {cost:.1f}"
            for name, cost in costs.most_common(5)
        )
        print(
            f"{tests} tests in {seconds:.0f} s; CPU-seconds of the slowest: {slowest}"
        )
