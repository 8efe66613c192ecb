"""Contents of the messages that a page and a recording get about a world.

All values are JSON; lengths are in metres, positions in the table frame, numbers
rounded to four decimals.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from marl_airhockey.core.scene import Scene
from marl_airhockey.envs.describe import what
from marl_airhockey.registry import make_agent
from marl_airhockey.types import Array
from marl_airhockey.world.world import World


def world_state(world: World) -> dict[str, Any]:
    """Return all that a page draws of the first world of a batch.

    ``pucks`` are rows x, y, vx, vy; ``marks`` are rows kind, ax, ay, bx, by, radius.
    """
    state = world.state.map(lambda x: x[0])
    memory = {name: value[0] for name, value in world.memory.items()}
    retired = world.scenario.retired(memory)
    return {
        "time": round(float(state.time), 3),
        "paddles": rounded(state.paddle),
        "pucks": rounded(np.hstack([state.puck, state.puck_velocity])),
        "puck_angles": rounded(state.angle[state.bodies.puck]),
        "blocks": rounded(state.position[state.bodies.block]),
        "angles": rounded(state.angle[state.bodies.block]),
        "marks": [
            [m.kind, *rounded(np.array([*m.start, *m.end, m.radius]))]
            for m in world.scenario.marks(state, memory)
        ],
        "caption": world.scenario.caption(memory),
        "returns": rounded(world.episode.returns[0]),
        "success": np.flatnonzero(world.episode.success[0]).tolist(),
        "retired": [] if retired is None else np.flatnonzero(retired).tolist(),
    }


def description(world: World) -> dict[str, Any]:
    """Return what never changes: the table, its seats, the limits of time and speed."""
    scene, table = world.scene, world.scene.table
    mouse: Any = make_agent("mouse")
    return {
        "scenario": world.scenario.name,
        "seconds": round(world.max_cycles * world.control_dt, 4),
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
        "mouse": {"gain": mouse.gain, "brake": mouse.brake},
        "what": what(world.scenario),
    }


def _goal_lines(scene: Scene) -> list[dict[str, Any]]:
    """Return the goals that have a width; ``owner`` is a seat, -1 for nobody's."""
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
