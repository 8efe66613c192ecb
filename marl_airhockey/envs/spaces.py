"""Gymnasium spaces of a world."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from marl_airhockey.contracts.observable import FRAMES
from marl_airhockey.contracts.scenario import GoalScenario
from marl_airhockey.core.physics import PUCK_SPEED_CAP
from marl_airhockey.types import Array
from marl_airhockey.world.observer import PIXELS, Observer
from marl_airhockey.world.world import World


def action_space() -> spaces.Box:
    """Wanted velocity as a fraction of top speed, ego frame: Box(-1, 1, (2,))."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def observation_space(observer: Observer, observe: str | None = None) -> Any:
    """Box, or the Dict of goals="dict"."""
    observe = observe or observer.observe
    if observe == "pixels":
        return spaces.Box(0, 255, (PIXELS, PIXELS, FRAMES), np.uint8)
    layout = observer.prepare(observe)
    flat = spaces.Box(layout.low, layout.high, dtype=np.float32)
    scenario = observer.scenario
    if scenario.goals == "flat" or not isinstance(scenario, GoalScenario):
        return flat
    high = np.array(scenario.goal_bounds, np.float32)
    goal = [spaces.Box(-high, high, dtype=np.float32) for _ in range(2)]
    return spaces.Dict(observation=flat, achieved_goal=goal[0], desired_goal=goal[1])


def state_space(world: World) -> spaces.Box:
    """Positions and velocities of all that moves, and the share of the time gone."""
    high = np.concatenate([_scale(world).ravel(), [1.0]]).astype(np.float32)
    low = -high
    low[-1] = 0.0
    return spaces.Box(low, high, dtype=np.float32)


def state_labels(world: World) -> tuple[str, ...]:
    """Return the name of each element of `global_state`."""
    bodies = world.scene.bodies
    kinds = ("paddle", bodies.paddles), ("puck", bodies.pucks), ("block", bodies.blocks)
    names = [f"{kind}_{i}" for kind, count in kinds for i in range(count)]
    columns = [f"{name}.{x}" for name in names for x in ("x", "y", "vx", "vy")]
    return (*columns, "time_share")


def global_state(world: World) -> Array:
    """(B, 4 movers + 1) float32, table frame, of the true state."""
    state, movers = world.state, world.scene.bodies.movers
    both = np.concatenate([state.position, state.velocity], -1)[:, :movers]
    bound = _scale(world)
    flat = np.clip(both, -bound, bound).reshape(len(both), -1)
    gone = np.minimum(world.episode.cycles / world.max_cycles, 1.0)[:, None]
    return np.concatenate([flat, gone], -1).astype(np.float32)


def _scale(world: World) -> Array:
    """(movers, 4) bounds of x, y, vx, vy; a puck out of play lies behind a goal."""
    bodies, corners = world.scene.bodies, np.asarray(world.scene.table.vertices)
    bound = np.zeros((bodies.movers, 4))
    bound[:, :2] = np.abs(corners).max(0) + 0.25
    bound[:, 2:] = PUCK_SPEED_CAP
    bound[bodies.paddle, 2:] = world.physics.highest("paddle_speed")
    return bound
