"""Evaluation of a driver in a scenario, over many episodes at once."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.evaluation.as_trained import as_trained, seen_in
from marl_airhockey.evaluation.deployability import Deployability
from marl_airhockey.evaluation.stats import bootstrap, interval, iqm, without_nan
from marl_airhockey.registry import DEFAULT_BACKEND, find_backend, make_agent
from marl_airhockey.types import Array
from marl_airhockey.world.build import (
    Keywords,
    build_driven_world,
    table_keywords,
)
from marl_airhockey.world.world import World

TEST_SEED = 2_000_000
"""First of the seeds that training never sees"""


@dataclass(frozen=True)
class EvaluationResult:
    """Measures of a driver over some episodes."""

    driver: str
    scenario: str
    backend: str
    profile: str
    episodes: int
    success: float
    success_interval: tuple[float, float]
    """95 % interval of the success, Wilson's"""
    first_shot: float
    """Share of episodes that succeeded before a second distinct touch"""
    returns: float
    """Mean return"""
    returns_iqm: float
    """Interquartile mean of the returns, robust against a few odd episodes"""
    returns_interval: tuple[float, float]
    """95 % interval of the interquartile mean, by bootstrap"""
    length: float
    """Mean length of an episode, control steps"""
    hits: float
    """Mean number of distinct touches in an episode"""
    deployability: Deployability
    interrupted: int = 0
    """Number of episodes that a real table had to end; they are no success"""
    interruptions: dict[str, int] = field(default_factory=dict)
    """Reasons of these, and how many episodes each of them ended"""
    observe: str = ""
    """Form of the driver's observations"""
    control_dt: float = 0.05
    """Time between two actions, s"""
    options: dict[str, Any] = field(default_factory=dict)
    """Options of the scenario that were given or trained with"""
    physics: Any = None
    """Physics that were given or trained with; None for the scenario's own"""
    drivers: dict[str, str] = field(default_factory=dict)
    """Drivers of other seats, by agent"""
    seed: int = TEST_SEED
    """Seed of the first episode"""

    def to_json(self) -> dict[str, Any]:
        """Return the fields as a JSON object, `returns` under the key "return"."""
        data: dict[str, Any] = without_nan(asdict(self))
        data["return"] = data.pop("returns")
        return data


def evaluate(
    player: object,
    scenario: str | Scenario | None = None,
    *,
    episodes: int = 200,
    seed: int = TEST_SEED,
    name: str | None = None,
    exact: bool = False,
    **keywords: Unpack[Keywords],
) -> EvaluationResult:
    """Let a player play episodes at ``paddle_0`` and measure it.

    What is not given is that of a policy's training: scenario, options, profile,
    observations, control_dt. The result names them. All episodes are played in one
    batch; on a real table they follow each other.

    Args:
        player: Driver, or what makes one, see `registry.make_agent`.
        scenario: Scenario, see `registry.find_scenario`; None for that of training.
        episodes: Number of episodes; episode i is the first of world i, with seed + i.
        seed: Seed of the first episode; training never sees those from 2,000,000 on.
        name: Name of the player in the result; None for its own.
        exact: Whether keywords that are not given have their defaults instead.
        **keywords: Keywords of the environment, drivers of other seats among them; see
            `build_world`.

    Raises:
        ValueError: A seat without a driver, one that does not fit, or a reward term
            that is nan, named.
    """
    driver, keywords = make_agent(player), table_keywords(keywords)
    name = name or name_of(player, driver)
    if not exact:
        scenario, keywords = as_trained({name: driver}, scenario, keywords)
        driver = seen_in(driver, keywords)
    if scenario is None:
        raise ValueError("scenario: say what the driver is to play")
    if episodes < 1:
        raise ValueError(f"episodes: {episodes} must be at least 1")
    name_of_backend = keywords.get("backend", DEFAULT_BACKEND)
    # On a real table episodes follow each other; elsewhere all are played at once.
    at_once = 1 if find_backend(name_of_backend).senses_itself else episodes
    world = build_driven_world(driver, scenario, at_once, keywords)
    statistics = EpisodeStatistics(episodes)
    try:
        for first in range(0, episodes, at_once):
            statistics.play(world, seed + first, slice(first, first + at_once))
        deployability = statistics.deployability(world)
    finally:
        world.close()
    success = float(statistics.success.mean())
    return EvaluationResult(
        driver=name,
        scenario=world.scenario.name,
        backend=keywords.get("backend", DEFAULT_BACKEND),
        profile=keywords.get("profile", "ideal"),
        episodes=episodes,
        success=success,
        success_interval=interval(success, episodes),
        first_shot=float(statistics.first_shot.mean()),
        returns=float(statistics.returns.mean()),
        returns_iqm=iqm(statistics.returns),
        returns_interval=bootstrap(statistics.returns, iqm),
        length=float(statistics.length.mean()),
        hits=float(statistics.hits.mean()),
        deployability=deployability,
        interrupted=len(statistics.interruptions),
        interruptions=dict(Counter(statistics.interruptions).most_common()),
        observe=driver.observe or world.observer.observe,
        control_dt=world.control_dt,
        options=dict(keywords.get("options", {})),
        physics=keywords.get("physics"),
        drivers={k: str(v) for k, v in keywords.get("drivers", {}).items()},
        seed=seed,
    )


def name_of(player: object, driver: Driver) -> str:
    """Return the name of a player in results: its own text, or its driver's."""
    if isinstance(player, (str, Path)):
        return str(player)
    return str(getattr(driver, "source", type(driver).__name__))


class EpisodeStatistics:
    """Statistics of episodes, and of ``paddle_0`` in them.

    Args:
        episodes: number of them.
    """

    def __init__(self, episodes: int) -> None:
        self.success, self.first_shot = np.zeros((2, episodes), np.bool_)
        self.returns, self.length, self.hits = np.zeros((3, episodes))
        self.interruptions: list[str] = []
        """Reasons of the episodes that a real table had to end."""
        self._violations = 0
        self._jerks: list[Array] = []
        self._actions: list[Array] = []
        """Actions (steps, 2) of each episode, nan after its end"""

    def play(self, world: World, seed: int, rows: slice) -> None:
        """Play an episode in each of B worlds, and keep it in B rows."""
        world.reset(seed)
        b, dt = world.num_worlds, world.control_dt
        done, no_actions = np.zeros(b, np.bool_), np.zeros((b, 0, 2))
        last, last_command = np.zeros((2, b, 2))
        actions: list[Array] = []
        while not done.all():
            result, live = world.step(no_actions), ~done
            self.length[rows] += live
            self._violations += int(((result.violation[:, 0, -1] > 0) & live).sum())
            command = world.command[:, 0]
            acceleration = (command - last_command) / dt
            self._jerks.append(((acceleration - last)[live] / dt).ravel())
            last, last_command = acceleration, command
            actions.append(np.where(live[:, None], world.action[:, 0], np.nan))
            ended = (result.terminated | result.truncated) & live
            self._end(world, ended, rows)
            if result.interruption:
                self.interruptions.append(result.interruption)
            done |= ended
        self._actions += list(np.stack(actions, 1))

    def _end(self, world: World, ended: Array, rows: slice) -> None:
        """Keep what the episodes that ended have come to."""
        episode = world.episode
        if np.isnan(episode.returns).any():
            bad = [name for name, term in world.terms.items() if np.isnan(term).any()]
            raise ValueError(f"{world.scenario.name}: reward terms {bad} are nan")
        self.success[rows][ended] = episode.success[ended, 0]
        self.first_shot[rows][ended] = episode.first_shot[ended]
        self.returns[rows][ended] = episode.returns[ended, 0]
        if "touches" in world.memory:
            self.hits[rows][ended] = world.memory["touches"].sum((-1, -2))[ended]

    def deployability(self, world: World) -> Deployability:
        """Return the driver's fitness for a real arm."""
        dt = world.control_dt
        return Deployability.of(
            self._violations / max(self.length.sum(), 1),
            self._rms_jerk(),
            self._power_above(5.0, dt),
            _act_ms(world),
            dt,
        )

    def _rms_jerk(self) -> float:
        """Return the root mean square of the commands' jerk, m/s3."""
        jerks = np.concatenate(self._jerks)
        return float(np.sqrt((jerks**2).mean()))

    def _power_above(self, frequency: float, dt: float) -> float:
        """Return the share of the actions' power above a frequency, Hz.

        It is nan if the frequency is not below half of the control rate.
        """
        if 0.5 / dt <= frequency:
            return float("nan")
        high = total = 0.0
        for action in self._actions:
            series = action[np.isfinite(action[:, 0])]
            if len(series) < 8:
                continue
            power = np.abs(np.fft.rfft(series - series.mean(0), axis=0)) ** 2
            above = np.fft.rfftfreq(len(series), dt) > frequency
            high, total = high + power[above].sum(), total + power.sum()
        return float(high / total) if total > 0 else 0.0


def _act_ms(world: World) -> float:
    """Return the median CPU time of a decision of paddle_0 in a single world, ms."""
    seat = world.driven[0]
    view = seat.view(world.known)
    state = view.state.map(lambda x: x[:1])
    seen = view.observation
    one = {k: v[:1] for k, v in seen.items()} if isinstance(seen, Mapping) else seen[:1]
    single = replace(
        view,
        state=state,
        read=lambda: one,
        top_speed=view.top_speed[:1],
        rng=view.rng.select(np.array([0])),
        scenario_memory={k: v[:1] for k, v in view.scenario_memory.items()},
    )
    memory = seat.driver.reset(world.scene.seats[0], single.rng, 1)
    times = []
    for _ in range(50):
        began = time.thread_time()
        seat.driver.act(single, memory)
        times.append(time.thread_time() - began)
    return float(np.median(times) * 1000)
