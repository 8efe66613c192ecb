"""Driver that predicts the puck and strikes it toward the target of the task."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, View, length, tactics


@dataclass
class Striker(tactics.Scripted):
    """Driver that predicts the puck and strikes it toward the target of the task.

    The paddle waits behind the predicted contact and strikes through it, for one puck
    at a time. The target is the goal, the centre of the blocks, or a point straight up
    the centre. In games it is the open goal. A puck at rest is struck at its position.
    """

    meet_at: float = 0.22
    """Distance of the hit of a falling puck from the near edge of the workspace, m."""
    back: float = 0.07
    """Distance behind the contact at which the paddle waits, m."""
    swing: float = 0.17
    """Time before the contact at which the strike begins, s."""
    pull: float = 0.94
    """Assumed acceleration of a falling puck, m/s2."""
    gain: float = 9.0
    """Commanded speed per distance to the target, 1/s."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        state, rows = view.state, np.arange(len(view.rng))
        own, top = state.paddle[:, view.seat], view.top_speed[:, None]
        if not state.bodies.pucks:
            return np.zeros_like(own), memory
        if view.scene.physics.get("tilt") == 0.0 and len(view.scene.seats) > 1:
            return self._play(view), memory
        low = view.reach[:, 0].min()
        which = (state.puck[..., 0] + 0.4 * state.puck_velocity[..., 0]).argmin(-1)
        puck, velocity = state.puck[rows, which], state.puck_velocity[rows, which]
        bodies = state.bodies
        touch = bodies.radius[view.seat] + bodies.radius[bodies.paddles]

        table = view.scene.table
        half = table.size[1] / 2 - table.puck_radius
        due, place = self._predict(puck, velocity, low + self.meet_at, half)
        rests = length(velocity) < 0.05
        place = np.where(rests[:, None], puck, place)
        out = self._target(view) - place
        out /= np.maximum(length(out), 1e-6)[:, None]
        came = velocity / np.maximum(length(velocity), 1e-6)[:, None]
        normal = np.where(rests[:, None], out, out - 0.55 * came)
        normal /= np.maximum(length(normal), 1e-6)[:, None]

        contact = place - normal * touch
        wait = contact - normal * self.back
        away = contact - own
        aside = length(away - (away * normal).sum(-1)[:, None] * normal)
        ready = rests & (aside < 0.012) & ((away * normal).sum(-1) > 0.0)
        ready &= (away * normal).sum(-1) < 0.25
        strike = ready | (~rests & (due < self.swing))
        through = normal * top + (away - (away * normal).sum(-1)[:, None] * normal) * 6
        rising = ~rests & (velocity[:, 0] > 0.1) & (puck[:, 0] > own[:, 0])
        home = np.stack([np.full(len(rows), low + 0.08), 0.6 * puck[:, 1]], -1)
        calm = np.where((rising & (due > 0.9))[:, None], home, wait)
        action = np.where(strike[:, None], through, (calm - own) * self.gain)
        return action / top, memory

    def _play(self, view: View) -> Array:
        """Return the actions in a game on a level table: strike, or wait at home."""
        field, (pace, lag) = tactics.Field.of(view.scene, view.seat), self._skill
        aim = tactics.open_goal(view, field)
        strike, due = tactics.attack(view, field, aim, pace, lag)
        own, low = view.state.paddle[:, view.seat], view.reach[:, 0].min()
        home = (np.array([low + 0.2, 0.0]) - own) * self.gain
        action = np.where(np.isfinite(due)[:, None], strike, home)
        return self._paced(action, view)

    def _predict(
        self, puck: Array, velocity: Array, line: float, half: float
    ) -> tuple[Array, Array]:
        """Predict when (W,), s, and where (W, 2), m, a puck falls to a line.

        The prediction includes wall bounces: |y| of the puck is at most ``half``, m.
        """
        drop = np.maximum(puck[:, 0] - line, 0.0)
        speed = velocity[:, 0]
        due = (speed + np.sqrt(speed * speed + 2 * self.pull * drop)) / self.pull
        far = puck[:, 1] + velocity[:, 1] * due + half
        folded = half - np.abs(far % (4 * half) - 2 * half)
        below = puck[:, 0] < line
        x = np.where(below, puck[:, 0], line)
        return np.where(below, 0.0, due), np.stack([x, folded], -1)

    @staticmethod
    def _target(view: View) -> Array:
        if "goal" in view.scenario_memory:
            return view.scenario_memory["goal"]
        if view.state.bodies.blocks:
            return np.asarray(view.state.block.mean(-2))
        return np.broadcast_to(np.array([0.6, 0.0]), (len(view.rng), 2))


make = Striker
