"""Velocities and contacts of a puck, computed from its measured positions."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from marl_airhockey.hardware.table.events import MeasuredPuck, find_contacts
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array


class Path(NamedTuple):
    """Trajectory of a body at T + 1 times."""

    time: Array
    """Times (T + 1,), s."""
    position: Array
    """Positions (T + 1, 2), table frame, m."""


def fill_events(state: State, scene: Scene, puck: Path, paddle: Path) -> None:
    """Compute contacts, wall bounces, crossed goal lines and velocity of one puck.

    Velocities are central differences of the positions. Next to a contact or a bounce
    they are one-sided differences.

    Args:
        state: States (T + 1, ...) of one paddle and one puck, changed in place.
        scene: Scene with the table, the sizes of bodies and the goal lines.
        puck: Trajectory of the puck at the times when it was detected.
        paddle: Trajectory of the paddle at all T + 1 times.
    """
    rows = np.searchsorted(paddle.time, puck.time)
    before, after = _one_sided(puck)
    central = np.gradient(puck.position, puck.time, axis=0)
    touching = False
    for k, (a, b) in enumerate(pairwise(rows)):
        first = MeasuredPuck(float(puck.time[k]), puck.position[k], before[k])
        last = MeasuredPuck(float(puck.time[k + 1]), puck.position[k + 1], after[k + 1])
        way = slice(a, b + 1)
        met = find_contacts(scene, first, last, paddle.time[way], paddle.position[way])
        touches = bool(np.isfinite(met.paddle_at))
        if touches and not touching:
            state.touched[b, 0, 0] = 1
            state.touched_at[b, 0, 0] = met.paddle_at - paddle.time[b - 1]
        touching = touches
        state.touching[b, 0, 0] = touches
        state.banked[b, 0] += met.banks
        for line, goal in enumerate(scene.goal_lines):
            if goal.width is None and met.banks[goal.side]:
                state.crossed[b, 0, line] = True
                state.crossed_velocity[b, 0, line] = met.velocity
        if touches or met.banks.any():
            central[k], central[k + 1] = before[k], after[k + 1]
    for axis in range(2):
        state.velocity[:, 1, axis] = np.interp(paddle.time, puck.time, central[:, axis])


def _one_sided(path: Path) -> tuple[Array, Array]:
    """Return velocities (T, 2) since the previous time, and until the next time."""
    if len(path.time) < 2:
        return np.zeros_like(path.position), np.zeros_like(path.position)
    steps = np.diff(path.position, axis=0) / np.diff(path.time)[:, None]
    return np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])
