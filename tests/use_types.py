"""Calls that the documentation shows, as the type checker of a user sees them.

`mypy --strict` checks this file; nothing runs it.
"""

from __future__ import annotations

import numpy as np
from gymnasium.vector import AutoresetMode

import marl_airhockey as ah


def builds_every_environment() -> None:
    """Use each keyword that a page documents."""
    ah.make_vec("juggle", 8, autoreset_mode="SameStep", render_mode="rgb_array")
    ah.make_vec("juggle", 8, autoreset_mode=AutoresetMode.DISABLED, profile="ur5e")
    ah.make_sb3_vec("juggle", 8, render_mode="rgb_array", physics={"tilt": 0.0})
    ah.make_torchrl("duel", 4, device="cpu", drivers={"paddle_1": "allround"})
    ah.gym_env("juggle", render_mode="rgb_array", viewpoint="top", goals="flat")
    ah.parallel_env("duel", "rgb_array", options={"goals_to_win": 3}, max_cycles=100)
    ah.env("duel", control_dt=0.02, observe="true", backend="pymunk")


def steps_worlds() -> float:
    """Read arrays of a step."""
    world = ah.make_world("duel", 4, seats="arcade")
    world.reset(0)
    step = world.step(np.zeros((4, 2, 2)))
    state, memory = world.get_state()
    world.set_state(state, memory)
    return float(step.reward.sum())
