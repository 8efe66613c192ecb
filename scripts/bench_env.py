"""Env-steps per CPU-second of the dict environment, in turns with others in one run.

    python scripts/bench_env.py --rounds 5 --seconds 2

Peers: a bare loop of Chipmunk's own step over the very same world (paddle velocities
set, pucks put back as often as episodes restart), PettingZoo's multiwalker (pip install
box2d) and mpe2's simple_tag. Actions are drawn beforehand; resets are included. Rates
are per CPU-second of this process, which a busy machine disturbs less than wall time;
ratios are medians over the rounds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer
from pymunk._chipmunk_cffi import lib
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.backends.pymunk import Pymunk

Run = Callable[[int], int]
"""Steps an environment so many times and returns how many agents it has."""
WORLDS = 256
CHUNK = 2 * WORLDS
"""Steps between two looks at the clock."""


def ours(scenario: str, backend: str) -> Run:
    """The PettingZoo environment of a scenario."""
    return parallel(ah.parallel_env(scenario, backend=backend))


def parallel(env: Any) -> Run:
    """Any PettingZoo ParallelEnv with random actions."""
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    agents = list(env.possible_agents)
    spaces = {agent: env.action_space(agent) for agent in agents}
    drawn: list[dict[str, Any]] = []
    for _ in range(512):
        row = {}
        for agent, space in spaces.items():
            if hasattr(space, "n"):
                row[agent] = int(rng.integers(space.n))
            else:
                row[agent] = rng.uniform(-1, 1, space.shape).astype(np.float32)
        drawn.append(row)
    count = 0

    def run(steps: int) -> int:
        nonlocal count
        for _ in range(steps):
            count += 1
            row = drawn[count & 511]
            live = env.agents
            if len(live) < len(agents):
                if not live:
                    env.reset()
                    continue
                row = {agent: row[agent] for agent in live}
            env.step(row)
        return len(agents)

    return run


def bare(scenario: str) -> Run:
    """Chipmunk's step alone over the world of our environment."""
    env = ah.parallel_env(scenario)
    env.reset(seed=0)
    backend = env.world.backend
    assert isinstance(backend, Pymunk)
    space, state = backend.spaces[0], env.world.state
    position, velocity = state.position[0], state.velocity[0]
    movers = len(space.bodies)
    raw, chipmunk = space.bodies[0]._body, space.space._space
    drawn = np.random.default_rng(0).uniform(-0.7, 0.7, (512, 2)).tolist()
    set_velocity, advance = lib.cpBodySetVelocity, lib.cpSpaceStep
    substeps, dt = space.substeps, space.sim_dt
    count = 0

    def run(steps: int) -> int:
        nonlocal count
        for _ in range(steps):
            count += 1
            if count % 40 == 0:
                space.start(position[:movers], velocity[:movers], state.angle[0])
            vx, vy = drawn[count & 511]
            set_velocity(raw, (vx if count & 1 else -vx, vy if count & 1 else -vy))
            for _ in range(substeps):
                advance(chipmunk, dt)
        return 1

    return run


def batched(scenario: str) -> Run:
    """Our arrays over many worlds at once, restarts included."""
    world = ah.make_world(scenario, WORLDS)
    world.reset(0)
    drawn = np.random.default_rng(0).uniform(-1, 1, (64, WORLDS, len(world.open), 2))
    count = 0

    def run(steps: int) -> int:
        nonlocal count
        for _ in range(steps // WORLDS):
            count += 1
            world.step(drawn[count & 63])
        return len(world.open)

    return run


def multiwalker() -> Run:
    """PettingZoo's multiwalker: three walkers on Box2D."""
    from pettingzoo.sisl import multiwalker_v9

    return parallel(multiwalker_v9.parallel_env())


def simple_tag() -> Run:
    """mpe2's simple_tag: four agents, numpy."""
    from mpe2 import simple_tag_v3

    return parallel(simple_tag_v3.parallel_env())


def rate(run: Run, seconds: float) -> tuple[float, int]:
    """Env-steps per CPU-second, and agents."""
    steps, began = 0, time.process_time()
    while (spent := time.process_time() - began) < seconds:
        agents = run(CHUNK)
        steps += CHUNK
    return steps / spent, agents


def main(
    scenario: Annotated[str, typer.Option(help="Ours.")] = "juggle",
    rounds: Annotated[int, typer.Option(help="Turns.")] = 5,
    seconds: Annotated[float, typer.Option(help="CPU-seconds a turn.")] = 2.0,
) -> None:
    """Run all in turns and print rates and ratios."""
    makers: dict[str, Callable[[], Run]] = {
        "ours, dict env": lambda: ours(scenario, "pymunk"),
        f"ours, {WORLDS} worlds": lambda: batched(scenario),
        "bare cpSpaceStep": lambda: bare(scenario),
        "multiwalker": multiwalker,
        "simple_tag": simple_tag,
    }
    console = Console()
    runs: dict[str, Run] = {}
    for name, maker in makers.items():
        try:
            runs[name] = maker()
            runs[name](CHUNK)
        except ImportError as error:
            console.print(f"{name}: left out ({error})")
    rates: dict[str, list[float]] = {name: [] for name in runs}
    agents: dict[str, int] = {}
    for _ in range(rounds):
        for name, run in runs.items():
            speed, agents[name] = rate(run, seconds)
            rates[name].append(speed)
    table = Table(title=f"{scenario}: {rounds} turns of {seconds} CPU-s")
    heads = ("env-steps per CPU-s", "spread", "agents", "ours / this", "per round")
    table.add_column("")
    for head in heads:
        table.add_column(head, justify="right")
    mine = rates["ours, dict env"]
    for name, found in rates.items():
        ratio = [a / b for a, b in zip(mine, found, strict=True)]
        middle = float(np.median(found))
        table.add_row(
            name,
            f"{middle:,.0f}",
            f"{(max(found) - min(found)) / middle:.0%}",
            str(agents[name]),
            f"{np.median(ratio):.3g}",
            f"{min(ratio):.3g}..{max(ratio):.3g}",
        )
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
