"""Suite of set pieces: how a driver solves it, and how two drivers differ."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Unpack

import numpy as np

from marl_airhockey.build import build_driven_world
from marl_airhockey.evaluation.evaluate import name_of
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.evaluation.suites.pieces import (
    CLASSES,
    STEPS_OF_ACTIONS,
    Pieces,
    load_pieces,
)
from marl_airhockey.evaluation.suites.set_piece import SetPiece
from marl_airhockey.registry import DEFAULT_BACKEND, is_live, make_driver
from marl_airhockey.rollouts.as_trained import as_trained, seen_in
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

AT_ONCE = 64
"""Largest number of pieces in one batch of a backend that is not compiled."""
COLUMNS = ("success", "violation", "state.touched")


class Piece(NamedTuple):
    """One piece of a suite."""

    seed: int
    """Seed with which an environment of the suite begins this piece."""
    position: Array
    """Positions of paddles and puck (3, 2), table frame, m."""
    velocity: Array
    """Velocities (3, 2), m/s."""
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


@dataclass(frozen=True)
class SuiteResult:
    """Result of a driver in a suite."""

    suite: str
    driver: str
    pieces: int
    success: float
    success_interval: tuple[float, float]
    """95 % interval of the success (Wilson)."""
    by_class: list[float]
    """Success in each class of difficulty, the easiest first."""
    by_class_intervals: list[tuple[float, float]]
    touched: float
    """Share of the pieces in which the driver touched the puck."""
    first_touch: float
    """Mean time of the first touch, s."""
    violations: float
    """Share of the control steps in which the action exceeded a limit."""

    def to_json(self) -> dict[str, Any]:
        """Return the fields as a JSON object."""
        return asdict(self)


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
        """Compare the solved pieces (N,) of two drivers."""
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
        return SetPiece(suite=self.name, **self.options)

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
        driver = make_driver(player)
        given: Keywords = {**keywords}
        given["drivers"] = {**self.drivers, **keywords.get("drivers", {})}
        scenario, given = as_trained(
            {name_of(player, driver): driver}, self.scenario, given
        )
        driver = seen_in(driver, given)
        n, backend = len(self), given.get("backend", DEFAULT_BACKEND)
        if is_live(backend):
            raise ValueError(
                f"backend {backend!r}: set pieces begin with moving pucks; use a "
                "simulation"
            )
        at_once = n if backend == DEFAULT_BACKEND else min(n, AT_ONCE)
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
        )

    def summarize(self, name: str, played: SuitePlay) -> SuiteResult:
        """Return the result of a driver with a name."""
        classes = [
            played.solved[self.pieces.difficulty == k + 1] for k in range(CLASSES)
        ]
        shares = [float(c.mean()) if len(c) else 0.0 for c in classes]
        solved, touched = float(played.solved.mean()), ~np.isnan(played.first_touch)
        return SuiteResult(
            suite=self.name,
            driver=name,
            pieces=len(self),
            success=solved,
            success_interval=interval(solved, len(self)),
            by_class=shares,
            by_class_intervals=[
                interval(share, max(len(c), 1))
                for share, c in zip(shares, classes, strict=True)
            ],
            touched=float(touched.mean()),
            first_touch=float(played.first_touch[touched].mean())
            if touched.any()
            else 0.0,
            violations=float(played.violations.mean()),
        )


def load_suite(name: str, **options: Any) -> Suite:
    """Return a suite of set pieces.

    Args:
        name: Name of a suite, such as ``defence-v1``, or path of a file.
        **options: Options of the scenario, such as ``reaction`` (s).

    Raises:
        ValueError: The name is unknown, the file is not a suite, or its pieces do not
            fit the options or this version of the rules.
    """
    found = Suite(name, options)
    assert len(found.scenario.pieces)
    return found


class Solution(Driver):
    """Driver of ``paddle_0`` that repeats the stored solution of each piece.

    Args:
        suite: Name of the suite, or path of its file.
    """

    def __init__(self, suite: str) -> None:
        self._actions = load_pieces(suite).solution / STEPS_OF_ACTIONS

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the piece and the number of the next step of each world."""
        piece = (rng.ordinals % np.uint64(len(self._actions))).astype(np.int64)
        return {"piece": piece, "step": np.zeros(worlds, np.int64)}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the next action of each solution."""
        step = np.minimum(memory["step"], self._actions.shape[1] - 1)
        actions = self._actions[memory["piece"], step]
        return actions, {**memory, "step": memory["step"] + 1}
