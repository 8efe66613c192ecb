"""Statistics of runs and games: intervals, robust means and ratings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from marl_airhockey.types import Array

RESAMPLES = 2000
"""Number of resamples of a bootstrap."""
FEWEST_GROUPS = 5
"""Smallest number of groups for which a jackknife gives an interval."""


def interval(share: float, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of n trials (Wilson, 1927)."""
    z = 1.96
    middle = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    return float(max(middle - half, 0.0)), float(min(middle + half, 1.0))


def iqm(values: Array) -> float:
    """Return the interquartile mean, the mean of the middle half.

    See Agarwal et al. (2021). A value at an edge of the middle half is weighted by the
    part of it that is inside. The result is therefore exact for any number of values.

    Raises:
        ValueError: There are no values.
    """
    ordered = np.sort(np.ravel(values)).astype(float)
    n = len(ordered)
    if not n:
        raise ValueError("iqm: no values")
    edges = np.arange(n + 1) / n
    inside = np.clip(edges[1:], 0.25, 0.75) - np.clip(edges[:-1], 0.25, 0.75)
    return float((inside * ordered).sum() / inside.sum())


def bootstrap(
    values: Array,
    statistic: Callable[[Array], float] = iqm,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> tuple[float, float]:
    """Return the 95 % percentile interval of a statistic.

    Args:
        values: Results of runs, (runs, ...). Whole rows are resampled with replacement.
        statistic: Function that computes the statistic of an array like ``values``.
        seed: Seed of the resampling.
        resamples: Number of resamples.
    """
    rows, rng = np.asarray(values), np.random.default_rng(seed)
    found = [
        statistic(rows[rng.integers(0, len(rows), len(rows))]) for _ in range(resamples)
    ]
    low, high = np.quantile(found, [0.025, 0.975])
    return float(low), float(high)


def over_tasks(
    runs: Sequence[Array],
    statistic: Callable[[Array], Any],
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> tuple[Array, Array, Array]:
    """Return a statistic of the runs of several tasks, and its 95 % interval.

    The interval is that of a stratified bootstrap (Agarwal et al., 2021): runs are
    resampled within their task. All tasks have the same weight.

    Args:
        runs: Results of the runs of each task, (n,).
        statistic: Function that computes a number or an array from results (m,).
        seed: Seed of the resampling.
        resamples: Number of resamples.

    Returns:
        Statistic, lower end and upper end.
    """
    rng, size = np.random.default_rng(seed), math.lcm(*map(len, runs))

    def of(chosen: Sequence[Array]) -> Array:
        pooled = [np.repeat(task, size // len(task)) for task in chosen]
        return np.asarray(statistic(np.concatenate(pooled)))

    found = [of([rng.choice(t, len(t)) for t in runs]) for _ in range(resamples)]
    low, high = np.quantile(found, [0.025, 0.975], axis=0)
    return of(runs), low, high


def performance_profile(values: Array, levels: Array) -> Array:
    """Return the share of results (n,) above each level (k,), an array (k,)."""
    return np.asarray((np.asarray(values) > np.asarray(levels)[:, None]).mean(1))


def bounded_mean(
    groups: Sequence[Sequence[float]], bounds: tuple[float, float], seed: int = 0
) -> list[float]:
    """Return the mean of bounded values in groups, and its 95 % interval.

    The interval is inside the bounds. It is the interval of a bootstrap over the
    groups, with percentiles that are expanded for small numbers of groups (Hesterberg,
    2015). It is nan for fewer than `FEWEST_GROUPS` groups. If all groups have the same
    mean, it is the interval of a share (Wilson, 1927).

    Args:
        groups: Values of groups that are independent of each other, such as people.
        bounds: Smallest and largest possible value.
        seed: Seed of the resampling.

    Returns:
        Mean, lower end and upper end.
    """
    chosen = [np.asarray(group, float) for group in groups if len(group)]
    if not chosen:
        return [np.nan] * 3
    sums = np.array([group.sum() for group in chosen])
    counts, n = np.array([len(group) for group in chosen]), len(chosen)
    mean = float(sums.sum() / counts.sum())
    if n < FEWEST_GROUPS:
        return [mean, np.nan, np.nan]
    if np.ptp(sums / counts) == 0.0:
        low, high = bounds
        ends = interval((mean - low) / (high - low), n)
        return [mean, *(low + (high - low) * end for end in ends)]
    drawn = np.random.default_rng(seed).integers(0, n, (RESAMPLES, n))
    means = sums[drawn].sum(1) / counts[drawn].sum(1)
    tail = NormalDist().cdf(-student_t(n - 1) * np.sqrt(n / (n - 1)))
    return [mean, *(float(x) for x in np.quantile(means, [tail, 1.0 - tail]))]


def student_t(degrees: int) -> float:
    """Return the 97.5 % quantile of Student's t distribution.

    The series of Abramowitz and Stegun (1964), 26.7.5, is accurate to 0.2 % for 3 or
    more degrees of freedom.
    """
    z, n = 1.959964, float(degrees)
    return float(
        z
        + (z**3 + z) / (4 * n)
        + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * n**2)
        + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * n**3)
        + (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z)
        / (92160 * n**4)
    )


def jackknife(
    groups: int, statistic: Callable[[list[int]], Array]
) -> tuple[Array, Array]:
    """Return the 95 % interval of a statistic of data in groups, such as people.

    Each group is left out once (Tukey, 1958). Data within a group, such as the games of
    a person, need not be independent.

    Args:
        groups: Number of groups, at least `FEWEST_GROUPS`.
        statistic: Function that computes a number or an array from the indices of the
            groups to use.

    Raises:
        ValueError: There are fewer than `FEWEST_GROUPS` groups.
    """
    if groups < FEWEST_GROUPS:
        raise ValueError(f"jackknife: {groups} groups; {FEWEST_GROUPS} are needed")
    every = list(range(groups))
    middle = statistic(every)
    left = np.array([statistic(every[:k] + every[k + 1 :]) for k in every])
    variance = (groups - 1) / groups * ((left - left.mean(0)) ** 2).sum(0)
    half = student_t(groups - 1) * np.sqrt(variance)
    return middle - half, middle + half


def probability_of_improvement(new: Array, old: Array) -> float:
    """Return the probability that a new run is better than an old one; ties count half.

    Args:
        new: Results of runs of the new method, (n,).
        old: Results of runs of the old method, (m,).
    """
    gap = np.sign(np.subtract.outer(np.ravel(new), np.ravel(old)))
    return float(0.5 + 0.5 * gap.mean())


def elo(score: Array, games: Array) -> Array:
    """Return Elo ratings of E players, (E,), 1000 on average (Bradley and Terry).

    A draw against an average player is added to the games of every player, so that the
    ratings of players without a win or without a loss are finite.

    Args:
        score: Points of the player of the row against that of the column, (E, E).
        games: Number of games between them, (E, E).
    """
    share = np.ones(len(score))
    won = score.sum(-1) + 0.5
    for _ in range(2000):
        expected = games / np.add.outer(share, share)
        new = won / (expected.sum(-1) + 1.0 / (share + 1.0))
        new /= np.exp(np.log(new).mean())
        if np.abs(np.log(new / share)).max() < 1e-9:
            break
        share = new
    return np.asarray(1000.0 + 400.0 * np.log10(share))


def nash_mixture(score: Array, temperature: float = 0.003) -> Array:
    """Return the mixture of E players that no player beats (Nash averaging).

    Both sides choose a player. Of all equilibria of this game, the result is close to
    the one with the largest entropy, in which copies of a player divide its share
    (Balduzzi and others, 2018). It is the logit equilibrium of a low temperature,
    computed by mirror steps with a look ahead, which converge.

    Args:
        score: Share of points of the player of the row against that of the column, (E,
            E).
        temperature: Temperature in points. A player whose score against the mixture is
            lower by this value has about a third of the share.

    Returns:
        Shares with a sum of 1, (E,).
    """
    edge, step = (score - score.T) / 2.0, 1.0
    keep = 1.0 - step * temperature
    weight = np.zeros(len(score))
    for _ in range(4000):
        ahead = keep * weight + step * edge @ _shares(weight)
        weight = keep * weight + step * edge @ _shares(ahead)
    share = _shares(weight)
    share[share < 1e-6] = 0.0
    return np.asarray(share / share.sum())


def _shares(weight: Array) -> Array:
    """Return the softmax of weights (E,)."""
    share = np.exp(weight - weight.max())
    return np.asarray(share / share.sum())


def without_nan(data: Any) -> Any:
    """Return nested dicts and lists with None for nan, which JSON does not have."""
    if isinstance(data, Mapping):
        return {name: without_nan(value) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [without_nan(value) for value in data]
    return None if isinstance(data, float) and np.isnan(data) else data
