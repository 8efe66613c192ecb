"""Contents of the messages that a page receives about a world.

All values are JSON. Lengths are in metres and positions in the table frame. Numbers are
rounded to four decimals.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from marl_airhockey.envs.describe import what
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.toolkit.pointing import BRAKE, GAIN
from marl_airhockey.types import Array, Memory


def drawn(
    scenario: Scenario, state: State, memory: Memory, returns: Array, success: Array
) -> dict[str, Any]:
    """Return the data of a world that a page draws.

    ``pucks`` are rows x, y, vx, vy. ``marks`` are rows kind, ax, ay, bx, by, radius,
    meaning (see `Mark`).

    Args:
        scenario: Scenario of the world.
        state: State, without leading axes.
        memory: Memory of the scenario, without leading axes.
        returns: Returns of the seats so far (seats,).
        success: Success of the seats (seats,), bool.
    """
    eliminated = scenario.eliminated(memory)
    return {
        "time": round(float(state.time), 3),
        "paddles": rounded(state.paddle),
        "pucks": rounded(np.hstack([state.puck, state.puck_velocity])),
        "puck_angles": rounded(state.angle[state.bodies.puck]),
        "blocks": rounded(state.position[state.bodies.block]),
        "angles": rounded(state.angle[state.bodies.block]),
        "marks": [
            [m.kind, *rounded(np.array(m.numbers)), m.means]
            for m in scenario.shown_marks(state, memory)
        ],
        "caption": str(scenario.caption(memory)),
        "decided_by": scenario.decided_by(memory),
        "returns": rounded(returns),
        "success": np.flatnonzero(success).tolist(),
        "eliminated": [] if eliminated is None else np.flatnonzero(eliminated).tolist(),
    }


def events(state: State) -> list[list[Any]]:
    """Return rows ["goal", goal line, puck] and ["hit", paddle, puck] of a step.

    Args:
        state: State after the step, without leading axes.
    """
    goals = [["goal", line, k] for k, line in np.argwhere(state.crossed).tolist()]
    hits = [["hit", i, k] for i, k in np.argwhere(state.touched > 0).tolist()]
    return goals + hits


def description(scenario: Scenario, seconds: float) -> dict[str, Any]:
    """Return the constant data: the table, its seats, and limits of time and speed.

    Args:
        scenario: Scenario of the world.
        seconds: Length of an episode, s.
    """
    scene, table = scenario.scene, scenario.scene.table
    return {
        "scenario": scenario.name,
        "title": title_of(scenario),
        "seconds": round(seconds, 4),
        "table": rounded(np.asarray(table.vertices)),
        "normals": rounded(table.normals),
        "paddle_radius": table.paddle_radius,
        "puck_radius": table.puck_radius,
        "block_radii": rounded(np.asarray(scene.bodies.radius[scene.bodies.block])),
        "block_shape": scene.block_shape,
        "obstacles": [
            [*o.start, *(o.end or o.start), o.radius] for o in scene.obstacles
        ],
        "goal_lines": _goal_lines(scene),
        "seats": [
            {
                "side": seat.side,
                "team": seat.team,
                "rotation": rounded(table.rotation(seat.side)),
                "reach": rounded(np.asarray(seat.reach)),
                "speed": seat.speed,
                "acceleration": seat.acceleration,
            }
            for seat in scene.seats
        ],
        "mouse": {"gain": GAIN, "brake": BRAKE},
        "what": what(scenario),
    }


def title_of(scenario: Scenario) -> str:
    """Return the title of a scenario for people who play it."""
    return scenario.title or scenario.name.replace("_", " ").capitalize()


def _goal_lines(scene: Scene) -> list[dict[str, Any]]:
    """Return the goals that have a width; ``owner`` is a seat, or -1 for no seat."""
    sides = [seat.side for seat in scene.seats]
    return [
        {
            "side": line.side,
            "owner": sides.index(line.side) if line.side in sides else -1,
            "ends": rounded(scene.opening(line)),
        }
        for line in scene.goal_lines
        if line.width is not None
    ]


def rounded(values: Array) -> Any:
    """Return an array as nested lists of numbers with four decimals."""
    return np.round(values, 4).tolist()
