"""Insight into a driver during play: what it observes, and how long it was trained."""

from __future__ import annotations

from functools import cache
from typing import Any

from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.messages import rounded
from marl_airhockey.policies.load import policy_file
from marl_airhockey.policies.next_goal import NextGoal
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.sim.core.extrapolation import Walls, extrapolate


def checkpoints(match: LiveMatch) -> list[dict[str, Any]]:
    """Return the fitting policies by the CPU time of their training, shortest first.

    Each row has ``name``, ``minutes`` and ``steps``. A match with a single policy has
    no rows, and neither has a real table: no page changes the driver of a moving arm.
    """
    if match.world.live is not None:
        return []
    rows = []
    for name in match.drivers.fitting_policies:
        card = NumpyPolicy.load(policy_file(name)).card
        if card.get("cpu_minutes") is not None:
            steps = card.get("steps")
            row = {"name": name, "minutes": card["cpu_minutes"], "steps": steps}
            rows.append(row)
    rows.sort(key=lambda row: row["minutes"])
    return rows if len(rows) > 1 else []


@cache
def _estimate(scenario: str) -> NextGoal | None:
    return NextGoal.load(scenario)


def observed(match: LiveMatch) -> dict[str, Any] | None:
    """Return what the first driver that is no person observes; None without one.

    ``seen`` are the positions of the pucks that ``seat`` observes, and ``predicted``
    those that it expects now, table frame, m: the extrapolation over the reaction time
    of the game, which is also a part of a policy's observation. ``next_goal`` is the
    estimated chance that the team of seat 0 scores the next goal; None without an
    estimate.
    """
    drivers = match.drivers
    programs = [i for i, name in enumerate(drivers.names) if name != PERSON]
    if not programs:
        return None
    seat = programs[0]
    pucks = drivers.observed(seat)
    if pucks is None:
        return None
    scene, reaction = match.world.scene, match.world.scenario.reaction
    now = pucks[:, :2]
    if reaction:
        now, _ = extrapolate(pucks[:, :2], pucks[:, 2:], reaction, Walls.of(scene))
    return {
        "seat": seat,
        "seen": rounded(pucks[:, :2]),
        "predicted": rounded(now),
        "next_goal": _next_goal(match),
        "latency": round(reaction + drivers.handicaps[seat].reaction, 3),
    }


def _next_goal(match: LiveMatch) -> float | None:
    scene, estimate = match.world.scene, _estimate(match.world.scenario.name)
    if estimate is None or not estimate.fits(scene):
        return None
    return round(estimate(match.world.state, scene), 3)
