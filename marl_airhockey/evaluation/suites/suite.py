"""Suite of set pieces: how a driver solves it, and how two drivers differ."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np

from marl_airhockey.build import build_driven_world
from marl_airhockey.evaluation.evaluate import name_of
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.evaluation.suites.pieces import (
    CLASSES,
    Pieces,
    load_pieces,
)
from marl_airhockey.evaluation.suites.set_piece import SetPiece
from marl_airhockey.registry import (
    DEFAULT_BACKEND,
    find_backend,
    find_scenario,
    is_live,
    make_driver,
)
from marl_airhockey.rollouts.as_trained import as_trained, seen_in
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.geometry import length
from marl_airhockey.sim.core.recording import Episode
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

AT_ONCE = 64
"""Largest number of pieces in one batch of a backend that is not compiled."""
COLUMNS = ("success", "violation", "state.touched", "state.velocity")


class Piece(NamedTuple):
    """One piece of a suite."""

    seed: int
    """Seed with which an environment of the suite begins this piece."""
    position: Array
    """Positions of paddles and puck (bodies, 2), table frame, m."""
    velocity: Array
    """Velocities (bodies, 2), m/s."""
    difficulty: int
    """Class of difficulty, 1 to 5."""


@dataclass(frozen=True)
class SuitePlay:
    """Outcome of a driver in each of N pieces."""

    solved: Array
    """True for solved pieces (N,)."""
    first_touch: Array
    """Time of the first touch by ``paddle_0`` (N,), s; nan without one."""
    violations: Array
    """Share of the control steps in which the action exceeded a limit (N,)."""
    acceleration: Array
    """Largest change of the paddle's velocity in a control step, divided by its length,
    (N,), m/s^2."""
    settings: dict[str, Any]
    """Keywords of the environment and options of the scenario that were given."""


@dataclass(frozen=True)
class SuiteResult:
    """Result of a driver in a suite."""

    suite: str
    driver: str
    pieces: int
    success: float
    success_interval: tuple[float, float]
    """95 % interval of the success (Wilson)."""
    by_class: list[float | None]
    """Success in each class of difficulty, the easiest first; None without a piece."""
    by_class_intervals: list[tuple[float, float] | None]
    touched: float
    """Share of the pieces in which the driver touched the puck."""
    first_touch: float
    """Mean time of the first touch, s."""
    violations: float
    """Share of the control steps in which the action exceeded a limit."""
    acceleration: float
    """Mean of the largest acceleration of the paddle in each piece, m/s^2."""
    settings: dict[str, Any]
    """Keywords of the environment and options of the scenario that were given."""


@dataclass(frozen=True)
class PairedDifference:
    """Difference between two drivers that played the same pieces."""

    only_first: int
    """Number of pieces that only the first driver solved."""
    only_second: int
    """Number of pieces that only the second driver solved."""
    p_value: float
    """Probability of a split at least as uneven if the drivers are equally good (exact
    test of McNemar, 1947)."""

    @staticmethod
    def of(first: Array, second: Array) -> PairedDifference:
        """Compare the solved pieces (N,) of two drivers.

        Raises:
            ValueError: The drivers played different numbers of pieces.
        """
        if first.shape != second.shape:
            raise ValueError(
                f"solved: shapes {first.shape} and {second.shape}; expected the same "
                "pieces"
            )
        a, b = int((first & ~second).sum()), int((second & ~first).sum())
        tail = sum(math.comb(a + b, k) for k in range(min(a, b) + 1))
        return PairedDifference(a, b, min(2 * tail / 2 ** (a + b), 1.0))


@dataclass(frozen=True)
class Suite:
    """Fixed set of pieces with one task, on which drivers are measured and compared.

    An environment of the suite is created from its scenario and its drivers::

        suite = ah.load_suite("defence-v1")
        env = ah.gym_env(suite.scenario, drivers=suite.drivers)
        observation, info = env.reset(seed=0)  # piece 0
    """

    name: str
    """Name, or path of the file."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the scenario that differ from its defaults, such as ``reaction``."""

    @cached_property
    def pieces(self) -> Pieces:
        """Pieces as arrays."""
        return load_pieces(self.name)

    @cached_property
    def scenario(self) -> SetPiece:
        """Scenario that begins with the pieces."""
        found = find_scenario(SetPiece, suite=self.name, **self.options)
        assert isinstance(found, SetPiece)
        return found

    @property
    def title(self) -> str:
        """Task in one sentence."""
        return self.pieces.task.title

    @property
    def drivers(self) -> dict[str, str]:
        """Drivers of the other seats, by agent."""
        return dict(self.pieces.task.drivers)

    def __len__(self) -> int:
        return len(self.pieces)

    def __iter__(self) -> Iterator[Piece]:
        found, rows = self.pieces, range(len(self))
        columns = found.position, found.velocity, found.difficulty.astype(int)
        return map(Piece._make, zip(rows, *columns, strict=True))

    def play(
        self, player: object, number: int = 0, **keywords: Unpack[Keywords]
    ) -> SuitePlay:
        """Let a driver play all pieces once.

        Args:
            player: Driver of ``paddle_0``, see `registry.make_driver`.
            number: Number of the repetition, from 0. Drivers that act at random have
                other random numbers in each.
            **keywords: Keywords of the environment, such as ``backend``.

        Raises:
            ValueError: The driver cannot play, or needs another observation.
        """
        n, backend = len(self), keywords.get("backend", DEFAULT_BACKEND)
        at_once = n if backend == DEFAULT_BACKEND else min(n, AT_ONCE)
        driver, scenario, given = self.prepare(player, **keywords)
        world = build_driven_world(driver, scenario, at_once, given)
        try:
            episodes = list(play_episodes(world, n, number * n, COLUMNS))
        finally:
            world.close()
        dt = world.control_dt
        touched = [e.columns["state.touched"][:, 0].any(-1) for e in episodes]
        return SuitePlay(
            np.array([e.columns["success"][-1, 0] > 0 for e in episodes]),
            np.array([t.argmax() * dt if t.any() else np.nan for t in touched]),
            np.array([(e.columns["violation"][:, 0, -1] > 0).mean() for e in episodes]),
            np.array([_peak(e) / dt for e in episodes]),
            {**keywords, **({"options": self.options} if self.options else {})},
        )

    def prepare(
        self, player: object, **keywords: Unpack[Keywords]
    ) -> tuple[Driver, str | Scenario, Keywords]:
        """Return a driver, and the scenario and keywords with which it plays.

        Args:
            player: Driver of ``paddle_0``, see `registry.make_driver`.
            **keywords: Keywords of the environment, such as ``backend``.

        Raises:
            ValueError: The driver cannot play, or needs another observation.
        """
        driver, backend = make_driver(player), keywords.get("backend", DEFAULT_BACKEND)
        _check(driver, backend, keywords)
        form = keywords.get("observe") or driver.observe or "velocity"
        requested: Keywords = {**keywords, "drivers": {**self.drivers}, "observe": form}
        name = name_of(player, driver)
        scenario, given = as_trained({name: driver}, self.scenario, requested)
        return seen_in(driver, given), scenario, given

    def summarize(self, name: str, played: SuitePlay) -> SuiteResult:
        """Return the result of a driver with a name.

        Raises:
            ValueError: Another number of pieces was played.
        """
        if len(played.solved) != len(self):
            raise ValueError(
                f"{self.name}: {len(played.solved)} pieces were played, and it has "
                f"{len(self)}"
            )
        classes = [
            played.solved[self.pieces.difficulty == k + 1] for k in range(CLASSES)
        ]
        shares = [float(c.mean()) if len(c) else None for c in classes]
        solved, touched = float(played.solved.mean()), ~np.isnan(played.first_touch)
        return SuiteResult(
            suite=self.name,
            driver=name,
            pieces=len(self),
            success=solved,
            success_interval=interval(solved, len(self)),
            by_class=shares,
            by_class_intervals=[
                None if share is None else interval(share, len(c))
                for share, c in zip(shares, classes, strict=True)
            ],
            touched=float(touched.mean()),
            first_touch=float(played.first_touch[touched].mean())
            if touched.any()
            else 0.0,
            violations=float(played.violations.mean()),
            acceleration=float(played.acceleration.mean()),
            settings=dict(played.settings),
        )


def _peak(episode: Episode) -> float:
    """Return the largest change of the velocity of ``paddle_0`` in a step, m/s."""
    first, later = (c["state.velocity"] for c in (episode.first, episode.columns))
    velocity = np.concatenate([first[None], later])[:, 0]
    return float(length(np.diff(velocity, axis=0)).max())


def _check(driver: Driver, backend: str, keywords: Keywords) -> None:
    """Raise ValueError if pieces cannot be played, or if they would be others."""
    if driver.needs_person or driver.needs_device:
        raise ValueError(f"{driver!r}: needs a person or a device; play by a policy")
    for name in ("drivers", "max_cycles"):
        if name in keywords:
            raise ValueError(f"{name}: the suite has its own; leave it out")
    if is_live(backend) or not find_backend(backend).instant_contacts:
        raise ValueError(
            f"backend {backend!r}: set pieces are too fast for an arm; use numba or "
            "pymunk"
        )


def load_suite(name: str | Path, /, **options: Any) -> Suite:
    """Return a suite of set pieces.

    Args:
        name: Name of a suite, such as ``defence-v1``, or path of a file.
        **options: Options of the scenario, such as ``reaction`` (s), or ``hide=False``
            to show pucks that pieces hide.

    Raises:
        ValueError: The name is unknown, the file is not a suite, or its pieces do not
            fit the options or this version of the rules.
    """
    if "suite" in options:
        raise ValueError(f"suite: the first argument is the suite, {str(name)!r}")
    found = Suite(str(name), options)
    assert len(found.scenario.pieces)
    return found
