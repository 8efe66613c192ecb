"""How fast environments step: whole env-steps, restarts included, random actions.

Rates are per CPU-second of this process and per second of wall time; cases are measured
in turns, because machines are shared.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.jit.threads import threads
from marl_airhockey.make import make_world, parallel_env

DRAWN = 64
"""Different actions, drawn beforehand."""


@dataclass(frozen=True)
class Case:
    """What is stepped; ``worlds`` 0 is the PettingZoo environment with its dicts."""

    scenario: str
    backend: str
    worlds: int

    @property
    def name(self) -> str:
        """For tables."""
        return f"{self.worlds} worlds" if self.worlds else "dict env"


@dataclass(frozen=True)
class Rate:
    """How fast a case is: medians over the rounds."""

    case: Case
    agents: int
    threads: int
    env_steps_per_cpu_s: float
    env_steps_per_s: float
    spread: float
    """Highest less lowest rate per CPU-second, as a share of the median"""

    @property
    def agent_steps_per_cpu_s(self) -> float:
        """Every agent's step counts."""
        return self.env_steps_per_cpu_s * self.agents

    def to_json(self) -> dict[str, Any]:
        """For a report."""
        return {
            "scenario": self.case.scenario,
            "backend": self.case.backend,
            "worlds": self.case.worlds,
            "agents": self.agents,
            "threads": self.threads,
            "env_steps_per_cpu_s": self.env_steps_per_cpu_s,
            "agent_steps_per_cpu_s": self.agent_steps_per_cpu_s,
            "env_steps_per_s": self.env_steps_per_s,
            "spread": self.spread,
        }


WARM = 100
"""Steps before the first turn: all is compiled then, and episodes are out of step."""


def measure(
    cases: Sequence[Case],
    rounds: int = 3,
    seconds: float = 1.0,
    report: Callable[[], None] = lambda: None,
) -> list[Rate]:
    """Measure cases in turns.

    Args:
        cases: what to step.
        rounds: turns.
        seconds: CPU-seconds of a turn of a case.
        report: called after every turn of a case.
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
        out.append(Rate(case, agents, threads(), cpu, wall, spread))
    return out


def _stepper(case: Case) -> tuple[Callable[[], int], int]:
    """What steps a case a few times and says how many env-steps that were; agents."""
    rng = np.random.default_rng(0)
    if case.worlds == 0:
        env = parallel_env(case.scenario, backend=case.backend)
        env.reset(seed=0)
        agents = env.possible_agents
        rows = [
            {agent: rng.uniform(-1, 1, 2).astype(np.float32) for agent in agents}
            for _ in range(8 * DRAWN)
        ]

        def play() -> int:
            for row in rows:
                if env.agents:
                    env.step(row)
                else:
                    env.reset()
            return len(rows)

        play()
        return play, len(agents)

    world = make_world(case.scenario, case.worlds, backend=case.backend)
    world.reset(0)
    turns = max(1, min(DRAWN, 4096 // case.worlds))
    drawn = rng.uniform(-1, 1, (DRAWN, case.worlds, len(world.open), 2))
    count = 0

    def step() -> int:
        nonlocal count
        for _ in range(turns):
            count += 1
            world.step(drawn[count % DRAWN])
        return turns * case.worlds

    while count < WARM:
        step()
    return step, len(world.open)


def _rate(run: Callable[[], int], seconds: float) -> tuple[float, float]:
    """Env-steps per CPU-second and per second."""
    steps, cpu, wall = 0, time.process_time(), time.perf_counter()
    while (spent := time.process_time() - cpu) < seconds:
        steps += run()
    return steps / spent, steps / (time.perf_counter() - wall)


def picture(rates: Sequence[Rate], path: Path) -> None:
    """Env-steps per CPU-second against the number of worlds, a line for each."""
    import matplotlib.pyplot as plt

    from marl_airhockey.evaluation.charts import DPI, save, tidy

    figure, axes = plt.subplots(figsize=(7.2, 4.4), dpi=DPI, layout="constrained")
    names = {(r.case.scenario, r.case.backend) for r in rates}
    for scenario, backend in sorted(names):
        mine = [
            r
            for r in rates
            if (r.case.scenario, r.case.backend) == (scenario, backend)
            and r.case.worlds
        ]
        mine.sort(key=lambda r: r.case.worlds)
        worlds = [r.case.worlds for r in mine]
        speed = [r.env_steps_per_cpu_s for r in mine]
        style = "-" if backend == "numba" else "--"
        axes.plot(worlds, speed, style, marker="o", label=f"{scenario}, {backend}")
    axes.set(
        xscale="log", yscale="log", xlabel="worlds", ylabel="env-steps per CPU-second"
    )
    tidy(axes)
    save(figure, path)
