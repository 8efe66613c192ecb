"""Checks of the number of open seats."""

from __future__ import annotations

from marl_airhockey.sim.world.world import World


def check_some_open(world: World) -> None:
    """Check that at least one seat is open.

    Raises:
        ValueError: The check fails. The message states what to do.
    """
    if not len(world.open):
        raise ValueError(
            f"drivers: every seat of {world.scenario.name!r} has a driver, so there is "
            "no agent; leave a seat out of drivers, or use make_world, whose actions "
            "then have the shape (num_worlds, 0, 2)"
        )


def check_one_open(world: World) -> None:
    """Check that exactly one seat is open.

    Raises:
        ValueError: The check fails. The message states what to do.
    """
    check_some_open(world)
    if len(world.open) > 1:
        agents = [f"paddle_{i}" for i in world.open]
        others = ", ".join(f'"{agent}": "still"' for agent in agents[1:])
        raise ValueError(
            f"{world.scenario.name!r} has open seats {agents}; a single-agent "
            "environment needs exactly one: give the others drivers, for example "
            f"drivers={{{others}}}"
        )
