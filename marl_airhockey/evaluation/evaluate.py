"""Play and measure: a driver in a scenario, over many episodes at once."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.evaluation.deployability import Deployability
from marl_airhockey.evaluation.stats import bootstrap, interval, iqm
from marl_airhockey.types import Array
from marl_airhockey.world.build import Keywords, build_world, find_scenario
from marl_airhockey.world.world import World

TEST_SEED = 2_000_000
"""First of the seeds that training never sees."""


@dataclass(frozen=True)
class Result:
    """What a driver achieved over some episodes."""

    driver: str
    scenario: str
    backend: str
    profile: str
    episodes: int
    success: float
    success_interval: tuple[float, float]
    """95 %, Wilson's."""
    first_shot: float
    """Share that succeeded before a second distinct touch."""
    returns: float
    returns_iqm: float
    """Interquartile mean, which a few odd episodes do not move."""
    returns_interval: tuple[float, float]
    """95 %, of the interquartile mean, by bootstrap."""
    length: float
    """Control steps, mean."""
    hits: float
    """Distinct touches, mean."""
    deployability: Deployability

    def to_json(self) -> dict[str, Any]:
        """For a report; `returns` is called return there."""
        data = asdict(self)
        data["return"] = data.pop("returns")
        return data


def seat_world(
    driver: Driver, scenario: str | Scenario, num_worlds: int, keywords: Keywords
) -> World:
    """Worlds in which a driver sits at ``paddle_0`` and at its mates' seats.

    All other seats must be driven, too.

    Raises:
        ValueError: a seat that nobody drives, named.
    """
    scene = find_scenario(scenario, keywords).scene
    team = [i for i, s in enumerate(scene.seats) if s.team == scene.seats[0].team]
    mates = {f"paddle_{i}": driver for i in team}
    drivers = {**mates, **keywords.get("drivers", {}), "paddle_0": driver}
    seated: Keywords = {**keywords, "drivers": drivers}
    world = build_world(scenario, num_worlds, autoreset=False, keywords=seated)
    if len(world.open):
        raise ValueError(
            f"{world.scenario.name!r} has more seats: say who drives paddle_"
            f"{world.open[0]}, e.g. --driver paddle_{world.open[0]}=goalkeeper"
        )
    return world


def evaluate(
    driver: Driver,
    name: str,
    scenario: str | Scenario,
    episodes: int = 200,
    seed: int = TEST_SEED,
    keywords: Keywords | None = None,
) -> Result:
    """Let a driver sit at ``paddle_0`` for some episodes, all at once.

    Args:
        driver: who plays.
        name: what to call it in the result.
        scenario: its name, or a scenario object.
        episodes: how many; episode i is world i's first with seed + i.
        seed: of the first episode.
        keywords: of the environment, drivers of other seats among them, see
            `make.build_world`.

    Raises:
        ValueError: a seat that nobody drives, named.
    """
    keywords = keywords if keywords is not None else {}
    world = seat_world(driver, scenario, episodes, keywords)
    world.reset(seed)
    tally = _Tally(world)
    nobody = np.zeros((episodes, 0, 2))
    while not tally.done.all():
        tally.add(world.step(nobody))
    success = float(tally.success.mean())
    result = Result(
        driver=name,
        scenario=world.scenario.name,
        backend=keywords.get("backend", "pymunk"),
        profile=keywords.get("profile", "ideal"),
        episodes=episodes,
        success=success,
        success_interval=interval(success, episodes),
        first_shot=float(tally.first_shot.mean()),
        returns=float(tally.returns.mean()),
        returns_iqm=iqm(tally.returns),
        returns_interval=bootstrap(tally.returns, iqm),
        length=float(tally.length.mean()),
        hits=float(tally.hits.mean()),
        deployability=Deployability.of(
            tally.violations / max(tally.length.sum(), 1),
            tally.rms_jerk(),
            tally.power_above(5.0),
            _act_ms(world),
            world.control_dt,
        ),
    )
    world.close()
    return result


class _Tally:
    """Counts the first episode of every world."""

    def __init__(self, world: World) -> None:
        self.world, b = world, world.num_worlds
        self.done = np.zeros(b, np.bool_)
        self.success, self.first_shot = np.zeros((2, b), np.bool_)
        self.returns, self.length, self.hits = np.zeros((3, b))
        self.violations = 0
        self._jolts: list[Array] = []
        self._actions: list[Array] = []
        self._pushed = np.zeros((b, 2))
        self._last = np.zeros((b, 2))

    def add(self, step: Any) -> None:
        """Take the step that was just made."""
        world, live = self.world, ~self.done
        dt = world.control_dt
        self.length += live
        self.violations += int(((step.violation[:, 0, -1] > 0) & live).sum())
        pushed = (world.command[:, 0] - self._last) / dt
        self._jolts.append(((pushed - self._pushed)[live] / dt).ravel())
        self._pushed, self._last = pushed, world.command[:, 0]
        self._actions.append(np.where(live[:, None], world.action[:, 0], np.nan))
        ended = (step.terminated | step.truncated) & live
        episode = world.episode
        self.success[ended] = episode.success[ended, 0]
        self.first_shot[ended] = episode.first_shot[ended]
        self.returns[ended] = episode.returns[ended, 0]
        if "touches" in world.memory:
            self.hits[ended] = world.memory["touches"].sum((-1, -2))[ended]
        self.done |= ended

    def rms_jerk(self) -> float:
        """Root mean square over all axes and steps, m/s3."""
        jolts = np.concatenate(self._jolts)
        return float(np.sqrt((jolts**2).mean()))

    def power_above(self, frequency: float) -> float:
        """Share of the asked actions' power above a frequency, Hz."""
        dt = self.world.control_dt
        if 0.5 / dt <= frequency:
            return float("nan")
        high = total = 0.0
        for action in np.stack(self._actions, 1):
            series = action[np.isfinite(action[:, 0])]
            if len(series) < 8:
                continue
            power = np.abs(np.fft.rfft(series - series.mean(0), axis=0)) ** 2
            above = np.fft.rfftfreq(len(series), dt) > frequency
            high, total = high + power[above].sum(), total + power.sum()
        return float(high / total) if total > 0 else 0.0


def _act_ms(world: World) -> float:
    """Median CPU time of a decision of paddle_0 in a single world, ms."""
    seat = world.driven[0]
    view = seat.view(world.sensed, world.memory, world.episode.physics)
    state = view.state.map(lambda x: x[:1])
    seen = view.observation
    one = {k: v[:1] for k, v in seen.items()} if isinstance(seen, Mapping) else seen[:1]
    single = replace(
        view,
        state=state,
        observation=one,
        top_speed=view.top_speed[:1],
        rng=view.rng.select(np.array([0])),
        scenario_memory={k: v[:1] for k, v in view.scenario_memory.items()},
    )
    memory = seat.driver.reset(world.scene.seats[0], single.rng, 1)
    times = []
    for _ in range(50):
        began = time.process_time()
        seat.driver.act(single, memory)
        times.append(time.process_time() - began)
    return float(np.median(times) * 1000)
