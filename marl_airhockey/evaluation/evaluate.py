"""Evaluation of a driver in a scenario, over many episodes at once."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from marl_airhockey.build import build_driven_world, scenario_of, table_keywords
from marl_airhockey.data.files import whole_recordings_in
from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.evaluation.comparison import Outcomes
from marl_airhockey.evaluation.deployability import Deployability
from marl_airhockey.evaluation.measures import COLUMNS, EpisodeStatistics
from marl_airhockey.evaluation.stats import bootstrap, interval, iqm, without_nan
from marl_airhockey.registry import DEFAULT_BACKEND, is_live, make_driver
from marl_airhockey.rollouts.as_trained import as_trained, seen_in
from marl_airhockey.rollouts.columns import head_of
from marl_airhockey.rollouts.rollout import play_episodes
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.checks import check_count, check_seed
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World

TEST_SEED = 2_000_000
"""First of the seeds that training never sees"""
MOST_STEPS = 1 << 21
"""Most control steps whose columns are in memory together, about 400 MB in a duel"""


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
        player: Driver, or what makes one, see `registry.make_driver`.
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
    episodes, seed = check_count("episodes", episodes), check_seed(seed)
    driver, keywords = make_driver(player), table_keywords(keywords)
    name = name or name_of(player, driver)
    if not exact:
        scenario, keywords = as_trained({name: driver}, scenario, keywords)
        driver = seen_in(driver, keywords)
    if scenario is None:
        raise ValueError("scenario: say what the driver is to play")
    # On a real table episodes follow each other; elsewhere many are played at once.
    real = is_live(keywords.get("backend", DEFAULT_BACKEND))
    game, dt = scenario_of(scenario, keywords), keywords.get("control_dt", 0.05)
    cycles = keywords.get("max_cycles") or round(game.seconds / dt)
    at_once = 1 if real else min(episodes, max(MOST_STEPS // cycles, 1))
    world = build_driven_world(driver, scenario, at_once, keywords)
    try:
        played = play_episodes(world, episodes, seed, COLUMNS)
        statistics = EpisodeStatistics(played, world.control_dt)
        head, act_ms = head_of(world, keywords), _act_ms(world)
    finally:
        world.close()
    head |= {"observe": driver.observe or head["observe"], "first_seed": seed}
    others = {k: str(v) for k, v in keywords.get("drivers", {}).items()}
    return _result(statistics, act_ms, head, name, others)


def evaluate_recording(path: Path) -> EvaluationResult:
    """Measure the first seat of a recording, as it was played.

    Args:
        path: Recording of a simulation, of a match on a page or of a real table.

    Raises:
        ValueError: No recording, one without steps, or one that lacks a column.
    """
    head, statistics = read_head(path), recorded_statistics(path)
    players = [str(row["person"] or row["driver"]) for row in head.get("players", [])]
    others = {f"paddle_{i}": name for i, name in enumerate(players) if i}
    driver = players[0] if players else path.name
    return _result(statistics, float("nan"), head, driver, others)


def recorded_statistics(path: Path) -> EpisodeStatistics:
    """Return the statistics of the episodes of a recording.

    Raises:
        ValueError: No recording, one without steps, or one that lacks a column.
    """
    whole_recordings_in([path])
    dt = float(read_head(path)["control_dt"])
    try:
        found = EpisodeStatistics(episodes_of(path, COLUMNS), dt)
    except KeyError as error:
        raise ValueError(f"{path}: there is no column {error} in it") from error
    if not len(found.success):
        raise ValueError(f"{path}: there are no steps in it")
    return found


def recorded_outcomes(paths: Sequence[Path]) -> Outcomes:
    """Return the outcomes of a method from recordings, each of one of its policies.

    Raises:
        ValueError: See `recorded_statistics`.
    """
    found = [recorded_statistics(path) for path in paths]
    lengths = [len(each.success) for each in found]
    return Outcomes(
        policy=np.repeat(np.arange(len(found)), lengths),
        success=np.concatenate([each.success for each in found]).astype(float),
        returns=np.concatenate([each.returns for each in found]),
        interrupted=np.concatenate([each.interrupted for each in found]).astype(float),
    )


def _result(
    statistics: EpisodeStatistics,
    act_ms: float,
    head: Mapping[str, Any],
    driver: str,
    drivers: dict[str, str],
) -> EvaluationResult:
    """Return the result of episodes.

    Args:
        statistics: Statistics of the episodes.
        act_ms: CPU time of a decision, ms; nan if it is not known.
        head: Head of their recording, which describes the environment.
        driver: Name of the driver that is measured.
        drivers: Names of the drivers of other seats, by agent.
    """
    episodes, success = len(statistics.success), float(statistics.success.mean())
    dt, returns = float(head["control_dt"]), statistics.returns
    return EvaluationResult(
        driver=driver,
        scenario=head["scenario"],
        backend=str(head.get("backend", DEFAULT_BACKEND)),
        profile=str(head.get("profile", "ideal")),
        episodes=episodes,
        success=success,
        success_interval=interval(success, episodes),
        first_shot=float(statistics.first_shot.mean()),
        returns=float(returns.mean()),
        returns_iqm=iqm(returns),
        returns_interval=bootstrap(returns, iqm),
        length=float(statistics.length.mean()),
        hits=float(statistics.touches.mean()),
        deployability=Deployability.of(
            statistics.violations, statistics.jerk, statistics.high_power, act_ms, dt
        ),
        interrupted=statistics.interruptions.total(),
        interruptions=dict(statistics.interruptions.most_common()),
        observe=str(head.get("observe", "")),
        control_dt=dt,
        options=dict(head.get("options", {})),
        physics=head.get("physics"),
        drivers=drivers,
        seed=int(head.get("first_seed", 0)),
    )


def name_of(player: object, driver: Driver) -> str:
    """Return the name of a player in results: its own text, or its driver's."""
    if isinstance(player, (str, Path)):
        return str(player)
    return str(getattr(driver, "source", type(driver).__name__))


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
