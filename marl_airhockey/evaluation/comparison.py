"""Comparison of methods by trials: results, differences and their intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np

from marl_airhockey.evaluation.stats import interval
from marl_airhockey.types import Array

Interval = tuple[float, float]
RESAMPLES = 4000
"""Number of resamples of a bootstrap."""


@dataclass(frozen=True)
class Outcomes:
    """Outcomes of n trials of one method."""

    policy: Array
    """Index of the policy of each trial, among the policies of the method, (n,)."""
    success: Array
    """1 for a success, else 0, (n,)."""
    returns: Array
    """Returns of the trials, (n,)."""
    interrupted: Array
    """1 where a real table ended the trial early, else 0, (n,)."""


@dataclass(frozen=True)
class Estimates:
    """Estimates of success and mean return, with 95 % intervals."""

    success: float
    success_interval: Interval
    """Interval of the success over policies and their trials. It contains the interval
    of the trials alone: Wilson's for a method, Newcombe's (1998) for a difference."""
    returns: float
    returns_interval: Interval
    """Interval of the mean return over policies and their trials."""


@dataclass(frozen=True)
class MethodResult(Estimates):
    """Result of all trials of a method."""

    name: str
    trials: int
    policies: int
    interrupted: int


@dataclass(frozen=True)
class Difference(Estimates):
    """Difference between two methods, the first minus the second."""

    first: str
    second: str


@dataclass(frozen=True)
class Comparison:
    """Comparison of methods."""

    methods: list[MethodResult]
    differences: list[Difference]

    def to_json(self) -> dict[str, Any]:
        """Return the fields as a JSON object."""
        return asdict(self)


def compare(methods: Mapping[str, Outcomes], seed: int = 0) -> Comparison:
    """Compare methods by their trials; trials are not paired by their start.

    Intervals are percentiles of a bootstrap in two stages. First the policies of a
    method are resampled with replacement, then the trials of each policy. If a method
    has several policies, the intervals therefore include the random variation between
    trainings.

    Args:
        methods: Outcomes by name of the method, with at least one trial of each.
        seed: Seed of the resampling.
    """
    rng = np.random.default_rng(seed)
    draws = {name: _resample(trials, rng) for name, trials in methods.items()}
    results = [_result(name, methods[name], draws[name]) for name in methods]
    by_name = {result.name: result for result in results}
    differences = []
    for first, second in combinations(methods, 2):
        gap = draws[first] - draws[second]
        a, b = by_name[first], by_name[second]
        differences.append(
            Difference(
                *(a.success - b.success, _wider(_middle(gap[:, 0]), _newcombe(a, b))),
                *(a.returns - b.returns, _middle(gap[:, 1])),
                *(first, second),
            )
        )
    return Comparison(results, differences)


def _resample(trials: Outcomes, rng: np.random.Generator) -> Array:
    """Return (RESAMPLES, 2) mean success and return of resampled trials."""
    values = np.stack([trials.success, trials.returns], 1)
    groups = [values[trials.policy == k] for k in np.unique(trials.policy)]
    found = np.empty((RESAMPLES, 2))
    for row in found:
        chosen = [groups[k] for k in rng.integers(0, len(groups), len(groups))]
        drawn = [group[rng.integers(0, len(group), len(group))] for group in chosen]
        row[:] = np.concatenate(drawn).mean(0)
    return found


def _result(name: str, trials: Outcomes, draws: Array) -> MethodResult:
    n, policies = len(trials.success), len(np.unique(trials.policy))
    success = float(trials.success.mean())
    return MethodResult(
        success,
        _wider(_middle(draws[:, 0]), interval(success, n)),
        float(trials.returns.mean()),
        _middle(draws[:, 1]),
        name,
        n,
        policies,
        int(trials.interrupted.sum()),
    )


def _newcombe(a: MethodResult, b: MethodResult) -> Interval:
    """Return the interval of a difference of shares from the intervals of both."""
    (low_a, high_a), (low_b, high_b) = (interval(x.success, x.trials) for x in (a, b))
    gap = a.success - b.success
    below = np.hypot(a.success - low_a, high_b - b.success)
    above = np.hypot(high_a - a.success, b.success - low_b)
    return gap - float(below), gap + float(above)


def _wider(drawn: Interval, counted: Interval) -> Interval:
    """Return the smallest interval that contains both.

    The bootstrap gives an interval of width 0 if all trials succeed.
    """
    return min(drawn[0], counted[0]), max(drawn[1], counted[1])


def _middle(values: Array) -> Interval:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
