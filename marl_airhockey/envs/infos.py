"""Infos: numbers beside observation and reward, with the same keys at every call.

They are flat, as most clients of PettingZoo and gymnasium expect.
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
    """Return the info of an open seat of the only world.

    Keys: ``applied_action`` (2,), ``success`` (latched), ``first_shot``, ``alive``,
    ``cost``, ``constraint/speed`` and so on, and ``reward/<term>``; on a real table
    ``interruption``, why it ended the episode, or "".

    Args:
        result: of a step of one world.
        world: the world.
        i: index among the open seats.
        alive: whether the seat still plays.
    """
    rows = result.violation[0, world.open[i]].tolist()
    speed, acceleration, jerk, reach, cost = rows
    # A dict display: this is a good part of the price of a step.
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
        result: of a step.
        world: the worlds.
        alive: (B,) bool: whether the seat still plays.
    """
    violation = result.violation[:, world.open[0]]
    columns = {name: violation[:, k] for k, name in enumerate(CONSTRAINTS)}
    return {
        "applied_action": result.applied_action[:, 0],
        "success": result.success[:, 0],
        # The name under which stable-baselines3 looks for it.
        "is_success": result.success[:, 0],
        "first_shot": result.first_shot,
        "alive": alive,
        "cost": result.cost[:, 0],
        **columns,
        **{_term(name): term[:, 0] for name, term in result.terms.items()},
    }
