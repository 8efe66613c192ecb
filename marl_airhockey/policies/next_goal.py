"""Estimate of which side scores the next goal, for games of two players."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.policies.load import ZOO
from marl_airhockey.policies.numpy_network import NumpyNetwork
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array

VALUES = ZOO / "values"
"""Folder of the estimates of this library."""


def views(state: State, scene: Scene) -> Array:
    """Return the state as both players view it, (..., 2, 12), m and m/s.

    A view has position and velocity of the own paddle, of the other paddle and of the
    puck, in the ego frame.
    """
    bodies = np.stack([state.position[..., :3, :], state.velocity[..., :3, :]], -2)
    found = []
    for seat, order in enumerate(([0, 1, 2], [1, 0, 2])):
        rotation = scene.table.rotation(scene.seats[seat].side)
        rotated = bodies[..., order, :, :] @ rotation.T
        found.append(rotated.reshape(*rotated.shape[:-3], 12))
    return np.stack(found, -2)


def scene_numbers(scene: Scene) -> list[float]:
    """Return the numbers of a scene on which an estimate depends.

    They are the size of the table, m, the widths of the goals, m, the top speeds of the
    seats, m/s, and the numbers of pucks and of bodies.
    """
    widths = [line.width or 0.0 for line in scene.goal_lines]
    speeds = [seat.speed for seat in scene.seats]
    size = scene.table.size.tolist()
    return [*size, *widths, *speeds, scene.pucks, len(scene.bodies)]


@dataclass(frozen=True)
class NextGoal:
    """Estimated chance that a side scores the next goal.

    The network gives one number to each view of a state. The chance is the logistic
    function of the difference of both numbers, so that the chances of both sides add up
    to 1. It was learned from games between many players, and it does not depend on the
    players. It is not the value function of a policy.

    Args:
        network: Network (B, 12) -> (B, 1). Its card has the `scene_numbers`.
    """

    network: NumpyNetwork

    @staticmethod
    def load(scenario: str) -> NextGoal | None:
        """Return the estimate for a scenario, by name; None if there is none."""
        path = VALUES / f"{scenario}.npz"
        return NextGoal(NumpyNetwork.load(path)) if path.exists() else None

    def fits(self, scene: Scene) -> bool:
        """Return True if table, goals, seats and bodies are those of the training."""
        return bool(scene_numbers(scene) == self.network.card["scene"])

    def __call__(self, state: State, scene: Scene) -> float:
        """Return the chance that the team of seat 0 scores the next goal.

        Args:
            state: True state of one world, with or without a leading axis.
            scene: Scene of the state, which must fit.
        """
        return float(self.chance(views(state, scene)).item())

    def chance(self, views: Array) -> Array:
        """Return the chance (...) that seat 0 scores next, for views (..., 2, 12)."""
        flat = self.network.forward(views.reshape(-1, views.shape[-1]))
        first, second = np.moveaxis(flat.reshape(views.shape[:-1]), -1, 0)
        return np.asarray(1.0 / (1.0 + np.exp(second - first)))
