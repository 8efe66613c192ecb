"""Measure the contact of the arm's paddle with the table, over every physics step.

    python scripts/reproduce/contact.py --steps 2000 --seeds 5

The cases are random actions, full speed in random directions, the juggling policy of
the zoo, and a duel between two arms with a policy of the zoo. Each has some seeds and
control steps with the physics of the profile ur5e. Height and tilt are extremes, and
the force is a mean.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import marl_airhockey as ah
from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

JOINT_LIMIT = 0.9 * np.pi
"""Limit of the speed of a joint, rad/s."""
ActionRule = Callable[[int, World], Array]
"""Function of step number and world that returns actions (B, open seats, 2)."""


def unsteady(seed: int) -> ActionRule:
    """Return a rule that samples an action at every step."""
    rng = np.random.default_rng(seed)
    return lambda k, world: rng.uniform(-1, 1, (world.num_worlds, len(world.open), 2))


def sweeping(seed: int) -> ActionRule:
    """Return a rule of full speed in a direction that changes every 0.6 s."""
    rng = np.random.default_rng(seed)
    held: dict[str, Array] = {}

    def actions(k: int, world: World) -> Array:
        if k % 12 == 0:
            angle = rng.uniform(0, 2 * np.pi, (world.num_worlds, len(world.open)))
            held["now"] = np.stack([np.cos(angle), np.sin(angle)], -1)
        return held["now"]

    return actions


def nobody(seed: int) -> ActionRule:
    """Return a rule without actions, because drivers have all seats."""
    return lambda k, world: np.zeros((world.num_worlds, len(world.open), 2))


CASES: tuple[tuple[str, str, dict[str, Any], Callable[[int], ActionRule]], ...] = (
    ("random", "juggle", {}, unsteady),
    ("full speed", "juggle", {}, sweeping),
    ("zoo/juggle", "juggle", {"drivers": {"paddle_0": "zoo/juggle"}}, nobody),
    (
        "zoo/duel_robot, two arms",
        "duel",
        {
            "drivers": {f"paddle_{i}": "zoo/duel_robot" for i in (0, 1)},
            "options": {"seats": "robot", "reaction": 0.0},
        },
        nobody,
    ),
)


def main(
    steps: Annotated[
        int, typer.Option(help="Number of control steps of each seed.")
    ] = 2000,
    seeds: Annotated[int, typer.Option(help="Number of seeds.")] = 5,
    profile: Annotated[
        str, typer.Option(help="Name of the profile: ideal, ur5e or gantry.")
    ] = "ur5e",
) -> None:
    """Measure all cases and print a table."""
    table = Table(title=f"{seeds} seeds of {steps} control steps, {profile} profile")
    for name in (
        "case",
        "lowest mm",
        "highest mm",
        "tilt deg",
        "force N",
        "joint rad/s",
    ):
        table.add_column(name)
    table.add_column("beyond the reach mm")
    for name, scenario, keywords, rule in CASES:
        world = ah.make_world(
            scenario, seeds, backend="robosuite", profile=profile, **keywords
        )
        world.reset(0)
        reach = ReachPlanes.of(world.scene.table, world.scene.seats)
        actions, trace, beyond = rule(0), [], 0.0
        for k in range(steps):
            world.step(actions(k, world))
            rows: Array = world.backend.trace
            trace.append([rows[..., 0].min(), rows[..., 0].max()])
            trace[-1] += [rows[..., 1].max(), rows[..., 2].mean(), rows[..., 3].max()]
            room = np.einsum("skd,bsd->bsk", reach.normals, world.state.paddle)
            beyond = max(beyond, float(-(room + reach.offsets).min()))
        found = np.array(trace)
        table.add_row(
            name,
            f"{1000 * found[:, 0].min():.2f}",
            f"{1000 * found[:, 1].max():.2f}",
            f"{np.degrees(found[:, 2].max()):.2f}",
            f"{found[:, 3].mean():.1f}",
            f"{found[:, 4].max():.2f} ({found[:, 4].max() / JOINT_LIMIT:.0%})",
            f"{1000 * beyond:.1f}",
        )
        world.close()
    Console().print(table)


if __name__ == "__main__":
    typer.run(main)
