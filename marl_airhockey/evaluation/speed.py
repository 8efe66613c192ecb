"""Speed of environments: environment steps with random actions, including resets.

Rates are per CPU-second of this process and per second of wall time. In every round
each case is measured once, so that the load of other processes affects all cases alike.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.make import make_world, parallel_env
from marl_airhockey.sim.jit.threads import threads
from marl_airhockey.sim.world.keywords import Keywords

NUM_ACTIONS = 64
"""Number of different actions, which are sampled in advance."""
WARM_UP_STEPS = 100
"""Number of steps before the first round. They compile the code and desynchronize the
episodes of the worlds."""


@dataclass(frozen=True)
class Case:
    """Environment to be measured; ``worlds=0`` is the PettingZoo environment."""

    scenario: str
    backend: str
    worlds: int
    observe: str = "velocity"
    """Observation type."""

    @property
    def name(self) -> str:
        """Name of the environment in tables."""
        return f"{self.worlds} worlds" if self.worlds else "dict env"


@dataclass(frozen=True)
class StepRate:
    """Speed of a case: medians over the rounds."""

    case: Case
    agents: int
    threads: int
    env_steps_per_cpu_s: float
    env_steps_per_s: float
    spread: float
    """Highest minus lowest rate per CPU-second, divided by the median."""

    @property
    def agent_steps_per_cpu_s(self) -> float:
        """Steps of single agents per CPU-second."""
        return self.env_steps_per_cpu_s * self.agents

    def to_json(self) -> dict[str, Any]:
        """Return case and rates as a JSON object."""
        return {
            "scenario": self.case.scenario,
            "backend": self.case.backend,
            "worlds": self.case.worlds,
            "observe": self.case.observe,
            "agents": self.agents,
            "threads": self.threads,
            "env_steps_per_cpu_s": self.env_steps_per_cpu_s,
            "agent_steps_per_cpu_s": self.agent_steps_per_cpu_s,
            "env_steps_per_s": self.env_steps_per_s,
            "spread": self.spread,
        }


def measure_speed(
    cases: Sequence[Case],
    rounds: int = 3,
    seconds: float = 1.0,
    report: Callable[[], None] = lambda: None,
) -> list[StepRate]:
    """Measure all cases, each once in every round.

    Args:
        cases: Environments to measure.
        rounds: Number of rounds.
        seconds: CPU-seconds of each measurement.
        report: Function that is called after every measurement.
    """
    runs = [_stepper(case) for case in cases]
    rates: list[list[tuple[float, float]]] = [[] for _ in cases]
    for _ in range(rounds):
        for (run, _), found in zip(runs, rates, strict=True):
            found.append(_rate(run, seconds))
            report()
    out = []
    for case, (_, agents), found in zip(cases, runs, rates, strict=True):
        cpu, wall = np.median(found, axis=0).tolist()
        spread = float(np.ptp([c for c, _ in found]) / cpu)
        out.append(StepRate(case, agents, threads(), cpu, wall, spread))
    return out


def _stepper(case: Case) -> tuple[Callable[[], int], int]:
    """Return a function that makes and counts environment steps, and the agents.

    Returns:
        Function that makes some steps and returns their number, and the number of
        agents.
    """
    rng = np.random.default_rng(0)
    keywords = Keywords(backend=case.backend, observe=case.observe)
    if case.worlds == 0:
        env = parallel_env(case.scenario, **keywords)
        env.reset(seed=0)
        agents = env.possible_agents
        rows = [
            {agent: rng.uniform(-1, 1, 2).astype(np.float32) for agent in agents}
            for _ in range(8 * NUM_ACTIONS)
        ]

        def step_env() -> int:
            for row in rows:
                if env.agents:
                    env.step(row)
                else:
                    env.reset()
            return len(rows)

        step_env()
        return step_env, len(agents)

    world = make_world(case.scenario, case.worlds, **keywords)
    world.reset(0)
    calls = max(1, min(NUM_ACTIONS, 4096 // case.worlds))
    actions = rng.uniform(-1, 1, (NUM_ACTIONS, case.worlds, len(world.open), 2))
    count = 0

    def step_worlds() -> int:
        nonlocal count
        for _ in range(calls):
            count += 1
            world.step(actions[count % NUM_ACTIONS])
        return calls * case.worlds

    while count < WARM_UP_STEPS:
        step_worlds()
    return step_worlds, len(world.open)


def _rate(run: Callable[[], int], seconds: float) -> tuple[float, float]:
    """Return environment steps per CPU-second and per second of wall time."""
    steps, cpu, wall = 0, time.process_time(), time.perf_counter()
    while (spent := time.process_time() - cpu) < seconds:
        steps += run()
    return steps / spent, steps / (time.perf_counter() - wall)


def plot_speed(rates: Sequence[StepRate], path: Path) -> None:
    """Plot environment steps per CPU-second against the number of worlds."""
    from marl_airhockey.sim.render.charts import panels, save, series

    kinds = [(r.case.scenario, r.case.backend, r.case.observe) for r in rates]
    figure, grid = panels(size=(7.2, 4.6))
    axes = grid[0, 0]
    for k, kind in enumerate(sorted(set(kinds))):
        mine = [
            r
            for r, own in zip(rates, kinds, strict=True)
            if own == kind and r.case.worlds
        ]
        mine.sort(key=lambda r: r.case.worlds)
        worlds = [r.case.worlds for r in mine]
        speed, look = [r.env_steps_per_cpu_s for r in mine], series(k)
        axes.plot(worlds, speed, label=", ".join(kind), **look.style)
    axes.set(
        xscale="log", yscale="log", xlabel="worlds", ylabel="env-steps per CPU-second"
    )
    spread = 100 * max(r.spread for r in rates)
    what = f"medians over rounds, whose range is at most {spread:.0f} %"
    save(figure, path, f"Speed with random actions:\n{what}")
