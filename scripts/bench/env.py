"""Compare the speed of environments with other libraries, in rounds of one run.

    python scripts/bench/env.py --rounds 5 --seconds 2 \
        --vmas X/bin/python --jaxmarl Y/bin/python

Single worlds are our PettingZoo environment, PettingZoo's multiwalker (pip install
box2d), mpe2's simple_tag, and a bare loop of pymunk's own step. The bare loop has the
same world: paddle velocities are set, and pucks are put back as often as episodes
restart.

Batches are our arrays, VMAS and JaxMARL. The last two run in separate interpreters that
only work in their rounds, on one thread like ours. Their scenarios have four agents, so
they are compared with our doubles.

Actions are sampled in advance, and resets are included. VMAS has no automatic reset.
All its worlds are reset together every 100 steps, which is its cheapest option. Rates
are per CPU-second of the process that steps, because a busy machine affects CPU time
less than wall time. A rate is the median over the rounds, and a ratio is that of two
medians. The table also has the spread and the range of the ratio over the rounds.
"""

from __future__ import annotations

import inspect
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.sim.backends.pymunk.backend import PymunkBackend

Play = Callable[[], int]
"""Function that makes some steps and returns the number of environment steps."""
Made = tuple[Play, int]
"""Function that steps an environment, and the number of agents."""
MeasureRound = Callable[[float], dict[str, float]]
"""Function that steps for some CPU-seconds and returns steps, agents and
CPU-seconds."""
CHUNK = 512
"""Number of steps of one world between two readings of the clock."""
PYMUNK_WORLDS, WORLDS = 256, 4096
ONE, MANY, FOUR = "env-steps", "agent-steps", "agent-steps of four agents"
"""Units of comparison: one world, many worlds, many worlds of four agents."""
ONE_THREAD = {
    "JAX_PLATFORMS": "cpu",
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
}
FOOTBALL = {
    "n_blue_agents": 2,
    "n_red_agents": 2,
    "ai_red_agents": False,
    "ai_blue_agents": False,
}
VMAS_HELP = "Interpreter with VMAS: python -m venv X && X/bin/pip install torch vmas."
JAX_HELP = "Interpreter with JaxMARL: python -m venv Y && Y/bin/pip install jaxmarl."


def parallel(env: Any) -> Made:
    """Return any PettingZoo ParallelEnv with random actions."""
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    agents = list(env.possible_agents)
    spaces = {agent: env.action_space(agent) for agent in agents}
    drawn: list[dict[str, Any]] = []
    for _ in range(CHUNK):
        row = {}
        for agent, space in spaces.items():
            if hasattr(space, "n"):
                row[agent] = int(rng.integers(space.n))
            else:
                row[agent] = rng.uniform(-1, 1, space.shape).astype(np.float32)
        drawn.append(row)

    def play() -> int:
        for row in drawn:
            if len(env.agents) < len(agents):
                if not env.agents:
                    env.reset()
                row = {agent: row[agent] for agent in env.agents}
            env.step(row)
        return CHUNK

    return play, len(agents)


def ours(scenario: str, backend: str) -> Made:
    """Return the PettingZoo environment of a scenario."""
    return parallel(ah.parallel_env(scenario, backend=backend))


def bare(scenario: str) -> Made:
    """Return Chipmunk's own step over the world of our environment."""
    env = ah.parallel_env(scenario, backend="pymunk")
    env.reset(seed=0)
    backend = env.world.backend
    assert isinstance(backend, PymunkBackend)
    space, state = backend.spaces[0], env.world.state
    position, velocity = state.position[0], state.velocity[0]
    paddle, chipmunk = space.bodies.all[0], space.space
    drawn = np.random.default_rng(0).uniform(-0.7, 0.7, (CHUNK, 2)).tolist()
    substeps, dt, touching = space.substeps, space.dt, state.touching[0]
    count = 0

    def play() -> int:
        nonlocal count
        for vx, vy in drawn:
            count += 1
            if count % 40 == 0:
                space.reset(position, velocity, state.angle[0], state.spin[0], touching)
            paddle.velocity = (vx, vy) if count & 1 else (-vx, -vy)
            for _ in range(substeps):
                chipmunk.step(dt)
        return CHUNK

    return play, 1


def worlds(scenario: str, backend: str, number: int) -> Made:
    """Return our arrays over many worlds, including restarts."""
    world = ah.make_world(scenario, number, backend=backend)
    world.reset(0)
    drawn = np.random.default_rng(0).uniform(-1, 1, (64, number, len(world.open), 2))
    count = 0

    def play() -> int:
        nonlocal count
        count += 1
        world.step(drawn[count & 63])
        return number

    return play, len(world.open)


def multiwalker() -> Made:
    """Return PettingZoo's multiwalker: three walkers on Box2D."""
    from pettingzoo.sisl import multiwalker_v9

    return parallel(multiwalker_v9.parallel_env())


def simple_tag() -> Made:
    """Return mpe2's simple_tag: four agents, NumPy."""
    from mpe2 import simple_tag_v3

    return parallel(simple_tag_v3.parallel_env())


def vmas(scenario: str, number: int, options: dict[str, Any]) -> Made:
    """Return an environment of VMAS; it runs in an interpreter that has VMAS."""
    torch = import_module("torch")
    torch.set_num_threads(1)
    make = import_module("vmas").make_env
    env = make(scenario, num_envs=number, device="cpu", seed=0, **options)
    torch.manual_seed(0)
    drawn = [
        [2 * torch.rand(number, *space.shape) - 1 for space in env.action_space]
        for _ in range(100)
    ]
    count = 0

    def play() -> int:
        nonlocal count
        if count % len(drawn) == 0:
            env.reset()
        env.step(drawn[count % len(drawn)])
        count += 1
        return number

    return play, len(env.agents)


def jaxmarl(scenario: str, number: int, length: int) -> Made:
    """Return an environment of JaxMARL, which scans a number of steps per call.

    It runs in an interpreter that has JaxMARL. Observations, rewards and dones are
    carried, so that the compiler cannot remove them.
    """
    jax = import_module("jax")
    env = import_module("jaxmarl").make(scenario)
    start, *given = jax.random.split(jax.random.PRNGKey(0), 2 + env.num_agents)
    keys = jax.random.split(given[0], (length, number))
    actions = {
        agent: jax.random.randint(key, (length, number), 0, env.action_space(agent).n)
        for agent, key in zip(env.agents, given[1:], strict=True)
    }
    step = jax.vmap(env.step)

    def advance(last: Any, row: Any) -> Any:
        return step(row[0], last[1], row[1])[:4], None

    scan = jax.jit(partial(jax.lax.scan, advance))
    _, state = jax.vmap(env.reset)(jax.random.split(start, number))
    last = step(keys[0], state, {a: rows[0] for a, rows in actions.items()})[:4]

    def play() -> int:
        nonlocal last
        last = jax.block_until_ready(scan(last, (keys, actions)))[0]
        return length * number

    return play, env.num_agents


def clocked(play: Play, agents: int, seconds: float) -> dict[str, float]:
    """Measure a round by the CPU clock of this process; it has at least one step."""
    began = time.process_time()
    steps = play()
    while (spent := time.process_time() - began) < seconds:
        steps += play()
    return {"steps": steps, "agents": agents, "cpu": spent}


def serve(make: Callable[..., Made], *args: Any) -> None:
    """Answer each line of seconds by a line of JSON; a peer process runs this."""
    with open(os.dup(1), "w") as answers:
        os.dup2(2, 1)  # Output that the library prints is not an answer.
        play, agents = make(*args)
        for line in sys.stdin:
            found = clocked(play, agents, float(line))
            print(json.dumps(found), file=answers, flush=True)


def peer(
    stack: ExitStack, python: Path, make: Callable[..., Made], *args: Any
) -> MeasureRound:
    """Start an environment in another interpreter, from the source of its functions."""
    program = "\n".join(
        (
            "from __future__ import annotations",
            "import json, os, sys, time",
            "from functools import partial",
            "from importlib import import_module",
            *(inspect.getsource(part) for part in (clocked, serve, make)),
            f"serve({make.__name__}, *{args!r})",
        )
    )
    child = stack.enter_context(
        subprocess.Popen(
            [python, "-I", "-c", program],
            env=os.environ | ONE_THREAD,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
    )
    asks, answers = child.stdin, child.stdout
    assert asks is not None
    assert answers is not None

    def measure_round(seconds: float) -> dict[str, float]:
        print(seconds, file=asks, flush=True)
        if not (line := answers.readline()):
            raise typer.BadParameter(f"{python}: no answer from {make.__name__}{args}")
        found: dict[str, float] = json.loads(line)
        return found

    return measure_round


@dataclass
class Row:
    """Environment that is measured, and its rounds; it is warmed up when created."""

    name: str
    measure_round: MeasureRound
    unit: str
    """Unit of comparison: `ONE`, `MANY` or `FOUR`."""
    found: list[dict[str, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.measure_round(0.0)

    @property
    def agents(self) -> int:
        """Number of agents."""
        return int(self.found[0]["agents"])

    def rates(self, unit: str) -> np.ndarray:
        """Return the rates per CPU-second, one for each round."""
        rates = np.array(
            [
                measure_round["steps"] / measure_round["cpu"]
                for measure_round in self.found
            ]
        )
        return rates if unit == ONE else rates * self.agents

    def to_json(self, mine: Row) -> dict[str, Any]:
        """Return the medians, and the ratio of our speed to this one."""
        steps = self.rates(ONE)
        these, others = mine.rates(self.unit), self.rates(self.unit)
        ratio = these / others
        return {
            "name": self.name,
            "env_steps_per_cpu_s": float(np.median(steps)),
            "agent_steps_per_cpu_s": float(np.median(steps)) * self.agents,
            "agents": self.agents,
            "spread": float(np.ptp(steps) / np.median(steps)),
            "compared": self.unit,
            "ours": mine.name,
            "ours_over_this": float(np.median(these) / np.median(others)),
            "lowest": float(ratio.min()),
            "highest": float(ratio.max()),
        }


def rows(
    stack: ExitStack,
    scenario: str,
    vmas_python: Path | None,
    jax_python: Path | None,
    number: int,
) -> list[Row]:
    """Return everything that can be measured, in groups of the same unit.

    The others of a group are compared with its first row.

    Args:
        stack: Stack that ends the interpreters of the other libraries.
        scenario: Our scenario.
        vmas_python: Interpreter that has VMAS.
        jax_python: Interpreter that has JaxMARL.
        number: Number of worlds of VMAS and JaxMARL.
    """
    out = []
    many = f"ours, {WORLDS} worlds, numba"
    doubles = f"ours, {WORLDS} worlds of doubles"
    few = f"ours, {PYMUNK_WORLDS} worlds, pymunk"
    here: list[tuple[str, str, Callable[[], Made]]] = [
        ("ours, dict env, numba", ONE, lambda: ours(scenario, "numba")),
        ("ours, dict env, pymunk", ONE, lambda: ours(scenario, "pymunk")),
        ("bare pymunk steps", ONE, lambda: bare(scenario)),
        ("multiwalker", ONE, multiwalker),
        ("mpe2 simple_tag", ONE, simple_tag),
        (many, MANY, lambda: worlds(scenario, "numba", WORLDS)),
        (few, MANY, lambda: worlds(scenario, "pymunk", PYMUNK_WORLDS)),
        (doubles, FOUR, lambda: worlds("doubles", "numba", WORLDS)),
    ]
    for name, unit, make in here:
        try:
            out.append(Row(name, partial(clocked, *make()), unit))
        except ImportError as error:
            print(f"{name}: skipped ({error})", file=sys.stderr)
    away: list[tuple[str, Path | None, Callable[..., Made], str, Any]] = [
        ("VMAS football", vmas_python, vmas, "football", FOOTBALL),
        ("VMAS simple_tag", vmas_python, vmas, "simple_tag", {}),
        ("JaxMARL simple_tag", jax_python, jaxmarl, "MPE_simple_tag_v3", 50),
    ]
    for name, python, make_peer, theirs, option in away:
        if python is not None:
            measure_round = peer(stack, python, make_peer, theirs, number, option)
            out.append(Row(f"{name}, {number} worlds", measure_round, FOUR))
    return out


def show(found: list[dict[str, Any]], title: str) -> Table:
    """Return a table, with a line between units."""
    ours = {row["compared"]: row["ours"] for row in found}
    units = "; ".join(f"{unit} of {name}" for unit, name in ours.items())
    table = Table("", title=title, caption=f"ours: {units}")
    heads = ("env-steps\nper CPU-s", "agent-steps\nper CPU-s", "agents", "spread")
    for head in (*heads, "ours / this", "per round"):
        table.add_column(head, justify="right")
    for row, after in zip(found, [*found[1:], found[-1]], strict=True):
        table.add_row(
            row["name"],
            f"{row['env_steps_per_cpu_s']:,.0f}",
            f"{row['agent_steps_per_cpu_s']:,.0f}",
            str(row["agents"]),
            f"{row['spread']:.0%}",
            f"{row['ours_over_this']:.3g}",
            f"{row['lowest']:.3g}..{row['highest']:.3g}",
            end_section=row["compared"] != after["compared"],
        )
    return table


Python = partial(typer.Option, exists=True, dir_okay=False)


def main(
    scenario: Annotated[
        str, typer.Option(help="Scenario of our environments.")
    ] = "juggle",
    rounds: Annotated[int, typer.Option(help="Number of rounds.", min=1)] = 5,
    seconds: Annotated[
        float, typer.Option(help="CPU-seconds of each case in a round.")
    ] = 2.0,
    vmas_python: Annotated[Path | None, Python("--vmas", help=VMAS_HELP)] = None,
    jax_python: Annotated[Path | None, Python("--jaxmarl", help=JAX_HELP)] = None,
    peer_worlds: Annotated[
        int, typer.Option(help="Number of worlds of VMAS and of JaxMARL.", min=1)
    ] = 1024,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure everything in rounds and print rates and ratios."""
    with ExitStack() as stack:
        measured = rows(stack, scenario, vmas_python, jax_python, peer_worlds)
        for _ in range(rounds):
            for row in measured:
                row.found.append(row.measure_round(seconds))
    mine = {row.unit: row for row in reversed(measured)}
    found = [row.to_json(mine[row.unit]) for row in measured]
    console = Console()
    if as_json:
        console.print_json(data=found)
        return
    console.width = max(console.width, 112)
    console.print(show(found, f"{scenario}: {rounds} rounds of {seconds} CPU-s"))


if __name__ == "__main__":
    typer.run(main)
