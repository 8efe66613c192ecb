"""Penalty on rough actions in training, for policies that a robot can follow."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array


class ActionPenalty:
    """Penalty on first and second differences of the action, and on exceeded limits.

    The penalty of a step is ``rate |a - b|^2 + jerk |a - 2 b + c|^2 + cost v``. Here a
    is the action, and b and c are the two actions before it, divided by the top speed.
    They are 0 before an episode. v is the sum of exceeded limits, see
    `limits.VIOLATIONS`.

    Args:
        rate: Weight of the squared change of the action.
        jerk: Weight of the squared second difference of the action.
        cost: Weight of the exceeded limits.
    """

    def __init__(self, rate: float, jerk: float, cost: float) -> None:
        self._weights = rate, jerk, cost
        self._last = np.zeros((0, 2))
        self._before = np.zeros((0, 2))

    def __call__(self, action: Array, violation: Array, ended: Array) -> Array:
        """Return the penalties (n,) of a step of n slots.

        Args:
            action: Requested actions, divided by the top speed, (n, 2).
            violation: Sum of the exceeded limits, (n,).
            ended: True where the episode ended with this step, (n,).
        """
        if len(self._last) != len(action):
            self._last, self._before = np.zeros((2, len(action), 2))
        rate, jerk, cost = self._weights
        change, last_change = action - self._last, self._last - self._before
        bend = change - last_change
        penalty = rate * (change**2).sum(-1) + jerk * (bend**2).sum(-1)
        going = ~ended[:, None]
        self._before, self._last = self._last * going, action * going
        return np.asarray(penalty + cost * violation)
