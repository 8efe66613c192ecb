"""Saves: shots on goal that a seat stopped."""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.scenario import Transition
from marl_airhockey.core.geometry import length
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.types import Array

SHOT = 1.0
"""Speed from which a puck on its way into a goal is a shot (m/s)."""


def on_goal(scene: Scene, state: State, seat: int) -> Array:
    """(..., pucks) bool: the puck flies straight into the goal of a seat's side."""
    side = scene.seats[seat].side
    width = next(g.width for g in scene.goal_lines if g.side == side)
    if width is None:
        raise ValueError(f"seat {seat}: its side has no goal of some width")
    normal, offset = scene.table.normals[side], scene.table.offsets[side]
    along = np.array([-normal[1], normal[0]])
    middle = sum(scene.table.ends(side)) @ along / 2.0
    place, motion = state.puck, state.puck_velocity
    nearing = -(motion * normal).sum(-1)
    due = ((place * normal).sum(-1) + offset) / np.maximum(nearing, 1e-6)
    aside = (place * along).sum(-1) + due * (motion * along).sum(-1) - middle
    there = (nearing > 0.0) & (np.abs(aside) < width / 2.0)
    return np.asarray(there & (length(motion) >= SHOT))


def saves(scene: Scene, t: Transition, toucher: Array) -> Array:
    """(..., seats, seats) number of shots of each seat (last axis) that each stopped.

    A seat stops a shot when its paddle touches a puck that flew straight into its goal
    at the start of the step and that a seat of another team had touched last.

    Args:
        scene: scene of the scenario; its goal lines have widths.
        t: transition.
        toucher: (..., pucks) number of who touched each puck last before the step, from
            1; 0 for nobody. See `possession.last_toucher`.
    """
    rows = []
    for i, keeper in enumerate(scene.seats):
        stopped = (t.after.touched[..., i, :] > 0) & on_goal(scene, t.before, i)
        shots = [
            (stopped & (toucher == 1 + k) & (shooter.team != keeper.team)).sum(-1)
            for k, shooter in enumerate(scene.seats)
        ]
        rows.append(np.stack(shots, axis=-1))
    return 1.0 * np.stack(rows, axis=-2)
