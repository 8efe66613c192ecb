"""Refusals of worlds whose open seats do not suit an environment."""

from __future__ import annotations

from marl_airhockey.sim.world.world import World


def check_some_open(world: World) -> None:
    """Refuse a world in which every seat has a driver.

    Raises:
        ValueError: Says what to do.
    """
    if not len(world.open):
        raise ValueError(
            f"drivers: every seat of {world.scenario.name!r} has one, so that no agent "
            "is left to act; leave a seat out of drivers, or use make_world, whose "
            "steps then take actions of shape (num_worlds, 0, 2)"
        )


def check_one_open(world: World) -> None:
    """Refuse a world that does not leave exactly one seat open.

    Raises:
        ValueError: Says what to do.
    """
    check_some_open(world)
    if len(world.open) > 1:
        agents = [f"paddle_{i}" for i in world.open]
        others = ", ".join(f'"{agent}": "still"' for agent in agents[1:])
        raise ValueError(
            f"{world.scenario.name!r} has open seats {agents}; a single-agent "
            "environment needs exactly one: give the others drivers, e.g. "
            f"drivers={{{others}}}"
        )
