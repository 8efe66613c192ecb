"""Evaluation of a driver in a scenario, over many episodes in one batch."""

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
"""First seed that training never uses."""
MOST_STEPS = 1 << 21
"""Largest number of control steps whose columns are in memory together, about 400 MB in
a duel."""


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
    """95 % interval of the success (Wilson)."""
    first_shot: float
    """Share of episodes that succeeded before a second distinct touch."""
    returns: float
    """Mean return."""
    returns_iqm: float
    """Interquartile mean of the returns, on which single outliers have little
    effect."""
    returns_interval: tuple[float, float]
    """95 % interval of the interquartile mean, by bootstrap."""
    length: float
    """Mean length of an episode, control steps."""
    hits: float
    """Mean number of distinct touches in an episode."""
    deployability: Deployability
    interrupted: int = 0
    """Number of episodes that a real table ended early; they do not count as a
    success."""
    interruptions: dict[str, int] = field(default_factory=dict)
    """Number of interrupted episodes by the reason of the interruption."""
    observe: str = ""
    """Observation type of the driver."""
    control_dt: float = 0.05
    """Time between two actions, s."""
    options: dict[str, Any] = field(default_factory=dict)
    """Options of the scenario that were given, or that the policy was trained with."""
    physics: Any = None
    """Physics parameters that were given, or that the policy was trained with; None for
    the defaults of the scenario."""
    drivers: dict[str, str] = field(default_factory=dict)
    """Drivers of other seats, by agent."""
    seed: int = TEST_SEED
    """Seed of the first episode."""

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
    """Let a driver play episodes at ``paddle_0`` and measure it.

    Scenario, options, profile, observation type and control_dt are those of the
    training of a policy, if they are not given. The result contains them. All episodes
    are played in one batch. On a real table they are played one after another.

    Args:
        player: Driver, or its name, path or class, see `registry.make_driver`.
        scenario: Scenario, see `registry.find_scenario`; None for the one of the
            training.
        episodes: Number of episodes. Episode i is the first one of world i and has the
            seed ``seed + i``.
        seed: Seed of the first episode. Training never uses seeds from 2,000,000 on.
        name: Name of the driver in the result; None for its own name.
        exact: True to use the defaults for keywords that are not given.
        **keywords: Keywords of the environment, including the drivers of other seats;
            see `build_world`.

    Raises:
        ValueError: A seat has no driver or one that does not fit, or a reward term is
            nan. The message names it.
    """
    episodes, seed = check_count("episodes", episodes), check_seed(seed)
    driver, keywords = make_driver(player), table_keywords(keywords)
    name = name or name_of(player, driver)
    if not exact:
        scenario, keywords = as_trained({name: driver}, scenario, keywords)
        driver = seen_in(driver, keywords)
    if scenario is None:
        raise ValueError("scenario: none was given; name the one to play")
    # A real table has one world; backends of simulations play many worlds in a batch.
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
    """Measure the first seat of a recording.

    Args:
        path: Recording of a simulation, of a match on the page or of a real table.

    Raises:
        ValueError: The path is not a recording, or the recording has no steps or lacks
            a column.
    """
    head, statistics = read_head(path), recorded_statistics(path)
    players = [str(row["person"] or row["driver"]) for row in head.get("players", [])]
    others = {f"paddle_{i}": name for i, name in enumerate(players) if i}
    driver = players[0] if players else path.name
    return _result(statistics, float("nan"), head, driver, others)


def recorded_statistics(path: Path) -> EpisodeStatistics:
    """Return the statistics of the episodes of a recording.

    Raises:
        ValueError: The path is not a recording, or the recording has no steps or lacks
            a column.
    """
    whole_recordings_in([path])
    dt = float(read_head(path)["control_dt"])
    try:
        found = EpisodeStatistics(episodes_of(path, COLUMNS), dt)
    except KeyError as error:
        raise ValueError(f"{path}: the recording has no column {error}") from error
    if not len(found.success):
        raise ValueError(f"{path}: the recording has no steps")
    return found


def recorded_outcomes(paths: Sequence[Path]) -> Outcomes:
    """Return the outcomes of a method from recordings, one for each of its policies.

    Raises:
        ValueError: A recording cannot be measured, see `recorded_statistics`.
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
        act_ms: CPU time of a decision, ms; nan if it is unknown.
        head: Head of the recording of the episodes, which describes the environment.
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
    """Return the name of a driver in results: the given text, or its own name."""
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
        read=lambda _: one,
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
