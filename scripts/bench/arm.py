"""Measure the speed of the arm: control steps per CPU-second, in rounds.

    python scripts/bench/arm.py --rounds 5

The cases are:

* robosuite's own Lift with a UR5e,
* our environment stepped by robosuite, with one arm and with two,
* the same models in the compiled steps of `backend="robosuite"`.

All have 20 control steps per second. Lift has robosuite's own time step of 2 ms. Our
environments have time steps of 1 ms and of 2 ms.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

Step = Callable[[], object]
"""Function that makes one control step."""


def make_scene(arms: int) -> Scene:
    """Return a scene with a puck and one or two arms."""
    table = TABLES["standard"]
    seats = tuple(make_seat("robot", table, side) for side in (0, 2)[:arms])
    return Scene(table, seats, pucks=1)


def lift() -> Step:
    """Return a function that steps robosuite's Lift."""
    import robosuite

    env = robosuite.make(
        "Lift",
        robots="UR5e",
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        control_freq=20,
        horizon=10**9,
        ignore_done=True,
        hard_reset=False,
    )
    env.reset()
    rng = np.random.default_rng(0)
    return lambda: env.step(rng.uniform(-1, 1, env.action_dim))


def stepped_by_robosuite(arms: int, timestep: float) -> Step:
    """Return a function that steps our environment by robosuite."""
    from marl_airhockey.sim.backends.robosuite.env import AirHockey

    env: Any = AirHockey(scene=make_scene(arms), timestep=timestep)
    env.reset()
    rng = np.random.default_rng(0)
    return lambda: env.step(rng.uniform(-1, 1, env.action_dim))


def compiled(arms: int, timestep: float) -> Step:
    """Return a function that makes the compiled step of the backend, without limits."""
    scene = make_scene(arms)
    backend = find_backend("robosuite")(scene, 1, 0.05, round(0.05 / timestep))
    state = scene.still_state(1)
    for i, hand in enumerate(backend.env.hands):  # type: ignore[attr-defined]
        state.position[0, i] = hand.home
    backend.reset(state, np.arange(1))
    phase, still = [0.0], Command.still(scene, 1)

    def step() -> object:
        phase[0] += 0.3
        direction = [np.cos(phase[0]), np.sin(phase[0])]
        velocity = np.full((1, arms, 2), 0.2) * direction
        return backend.step(still._replace(velocity=velocity))

    return step


def main(
    rounds: Annotated[int, typer.Option(help="Number of rounds.")] = 5,
    seconds: Annotated[
        float, typer.Option(help="CPU-seconds of each case in a round.")
    ] = 2.0,
) -> None:
    """Measure all cases and print a table."""
    log = logging.getLogger("robosuite_logs")
    log.addFilter(lambda record: record.levelno >= logging.ERROR)
    cases: dict[str, Step] = {"Lift, UR5e, 2 ms": lift()}
    for arms in (1, 2):
        for timestep in (0.002, 0.001):
            label = f"{arms} arm{'s' * (arms > 1)}, {1000 * timestep:.0f} ms"
            cases[f"robosuite's steps, {label}"] = stepped_by_robosuite(arms, timestep)
            cases[f"backend, {label}"] = compiled(arms, timestep)
    rates: dict[str, list[float]] = {name: [] for name in cases}
    for step in cases.values():
        step()
    for _ in range(rounds):
        for name, step in cases.items():
            began, count = time.process_time(), 0
            while time.process_time() - began < seconds:
                step()
                count += 1
            rates[name].append(count / (time.process_time() - began))
    first = np.median(rates["Lift, UR5e, 2 ms"])
    table = Table("case", title=f"{rounds} rounds of {seconds} CPU-s")
    for name in ("control steps per CPU-s", "spread", "of Lift"):
        table.add_column(name, justify="right")
    for name, found in rates.items():
        middle = np.median(found)
        spread = f"{min(found):.0f}..{max(found):.0f}"
        table.add_row(name, f"{middle:.0f}", spread, f"{middle / first:.1f}")
    Console().print(table)


if __name__ == "__main__":
    typer.run(main)
