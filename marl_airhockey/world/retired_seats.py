"""Retired seats: their paddles stand behind their sides, whose goals are wall."""

from __future__ import annotations

import numpy as np

from marl_airhockey.core.scene import Scene
from marl_airhockey.types import Array


class RetiredSeats:
    """Parking places of the seats of a scene, and the goals that they own.

    Args:
        scene: with a goal line or more.
    """

    def __init__(self, scene: Scene) -> None:
        table, sides = scene.table, [seat.side for seat in scene.seats]
        behind = table.offsets[sides] + 2 * table.paddle_radius
        self._parking = np.zeros((len(sides), 4))
        self._parking[:, :2] = -table.normals[sides] * behind[:, None]
        lines = [line.side for line in scene.goal_lines]
        owners = [sides.index(side) if side in sides else -1 for side in lines]
        self._owner = np.array(owners, np.int64)

    def retire(
        self,
        retired: Array,
        action: Array,
        prescribed: Array,
        closed: Array,
        raised: Array,
    ) -> None:
        """Lift the paddles of retired seats off and close their goals, in place.

        Args:
            retired: (B, seats) bool.
            action: (B, seats, 2) see `ControlStep`, as the next two.
            prescribed: (B, seats, 4).
            closed: (B, goal_lines).
            raised: (B, seats).
        """
        action[retired], raised[retired] = 0.0, True
        parking = np.broadcast_to(self._parking, prescribed.shape)
        prescribed[retired] = parking[retired]
        closed[:] = retired[:, self._owner] & (self._owner >= 0)
