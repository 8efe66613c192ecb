"""Infos: further results of a step, with the same keys in every call.

They are flat, as most users of PettingZoo and gymnasium expect.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from marl_airhockey.sim.core.limits import VIOLATIONS
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

CONSTRAINTS = tuple(f"constraint/{name}" for name in VIOLATIONS[:-1])
"""Keys of the excess of an action over each limit, in the order of `VIOLATIONS`."""
_SPEED, _ACCELERATION, _JERK, _REACH = CONSTRAINTS


@cache
def _term(name: str) -> str:
    return f"reward/{name}"


def info_of(result: StepResult, world: World, i: int, alive: bool) -> dict[str, Any]:
    """Return the info of an open seat of a single world.

    The keys are ``applied_action`` (2,), ``success`` of the episode so far,
    ``first_shot``, ``alive``, ``cost``, ``reward/<term>`` and `CONSTRAINTS`. On a real
    table ``interruption`` is the reason why it ended the episode, or "".

    Args:
        result: Result of a step of one world.
        world: World of the result.
        i: Index of the seat among the open seats.
        alive: True if the seat is not eliminated.
    """
    rows = result.violation[0, world.open[i]].tolist()
    speed, acceleration, jerk, reach, cost = rows
    # A dict display, because this takes a considerable part of the time of a step.
    info = {
        "applied_action": result.applied_action[0, i],
        "success": result.success.item(i),
        "first_shot": result.first_shot.item(0),
        "alive": alive,
        "cost": cost,
        _SPEED: speed,
        _ACCELERATION: acceleration,
        _JERK: jerk,
        _REACH: reach,
    }
    for name, term in result.terms.items():
        info[_term(name)] = term.item(i)
    if world.live is not None:
        info["interruption"] = result.interruption
    return info


def infos_of(result: StepResult, world: World, alive: Array) -> dict[str, Array]:
    """Return the infos of the only open seat of B worlds, arrays (B, ...).

    Args:
        result: Result of a step of B worlds.
        world: Worlds of the result.
        alive: True for worlds in which the seat is not eliminated (B,).
    """
    violation = result.violation[:, world.open[0]]
    columns = {name: violation[:, k] for k, name in enumerate(CONSTRAINTS)}
    return {
        "applied_action": result.applied_action[:, 0],
        "success": result.success[:, 0],
        # Stable-baselines3 reads the success under this name.
        "is_success": result.success[:, 0],
        "first_shot": result.first_shot,
        "alive": alive,
        "cost": result.cost[:, 0],
        **columns,
        **{_term(name): term[:, 0] for name, term in result.terms.items()},
    }
