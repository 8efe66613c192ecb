"""Actions of all seats in a step: open, driven and eliminated ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.sensing.delay import Delay
from marl_airhockey.sim.world.driven_seat import DrivenSeat
from marl_airhockey.sim.world.known import Known
from marl_airhockey.types import Array


class Inputs(NamedTuple):
    """Inputs of a control step; preallocated arrays, overwritten in every step."""

    action: Array
    """Actions after their latency (B, seats, 2), in units of top speed, ego frames."""
    prescribed: Array
    """Positions, m, and velocities, m/s, of position-driven paddles (B, seats, 4),
    table frame; nan for all others."""
    closed: Array
    """True for goal lines that are wall (B, goal_lines)."""
    raised: Array
    """True for paddles above the table, which touch nothing (B, seats)."""

    @staticmethod
    def empty(scene: Scene, worlds: int) -> Inputs:
        """Return inputs of paddles at rest, in new arrays."""
        still = Command.still(scene, worlds)
        action = np.zeros((worlds, len(scene.seats), 2))
        return Inputs(action, still.prescribed, still.closed, still.raised)


class Actions:
    """Collector of the actions of B worlds, which applies the action latency.

    Args:
        scenario: Scenario, which defines the eliminated seats.
        driven: Seats with drivers inside the environment.
        open_seats: Indices of the open seats (open,).
        physics: Ranges of the physics parameters, for the action latency.
        worlds: Number of worlds, B.
        control_dt: Length of a control step, s.
    """

    def __init__(
        self,
        scenario: Scenario,
        driven: Sequence[DrivenSeat],
        open_seats: Array,
        physics: Physics,
        worlds: int,
        control_dt: float,
    ) -> None:
        scene, longest = scenario.scene, physics.highest("action_delay")
        self._scenario, self._driven, self._open = scenario, driven, open_seats
        self._rotations = [scene.table.rotation(seat.side) for seat in scene.seats]
        self._elimination = Elimination(scene)
        self._shape = (worlds, len(open_seats), 2)
        self.inputs = Inputs.empty(scene, worlds)
        """Inputs of the step, which `collect` fills."""
        shape = self.inputs.action.shape
        self._delay = Delay(longest, control_dt, shape) if longest else None
        self._positioned = False
        """True if the last step had position-driven paddles or closed goals."""

    def reset(self, worlds: Array) -> None:
        """Discard the delayed actions of some worlds, by index (W,)."""
        if self._delay is not None:
            self._delay.fill(worlds, 0.0)

    def collect(self, actions: Array, prescribed: Array | None, known: Known) -> Array:
        """Fill `inputs`; return the actions (B, seats, 2) before their latency.

        Args:
            actions: Actions of the open seats (B, open, 2).
            prescribed: Positions and velocities of position-driven paddles of open
                seats (B, open, 4), ego frames, m and m/s; nan for seats with actions.
                None if all seats have actions.
            known: Knowledge of the seats before the step.

        Raises:
            ValueError: A shape is wrong, or an element of ``prescribed`` is infinite.
        """
        if prescribed is not None and np.isinf(prescribed).any():
            raise ValueError("position-driven seat: no element may be infinite")
        if actions.shape != self._shape:
            raise ValueError(
                f"actions: expected shape {self._shape}, got {actions.shape}"
            )
        inputs, requested = self.inputs, self.inputs.action
        if self._positioned:
            inputs.prescribed[:], inputs.closed[:] = np.nan, False
            inputs.raised[:] = self._positioned = False
        if not self._driven:
            requested[:] = actions
        else:
            requested[:, self._open] = actions
        if prescribed is not None:
            for k, measured in zip(self._open, prescribed.swapaxes(0, 1), strict=True):
                self._position(int(k), measured)
        for seat in self._driven:
            k, acts = seat.index, seat.acts
            if acts:
                requested[:, k] = seat.act(known)
            measured = seat.measured()
            if measured is not None:
                self._position(k, measured, acts)
        eliminated = self._scenario.eliminated(known.memory)
        if eliminated is not None and eliminated.any():
            self._elimination.apply(eliminated, inputs)
            self._positioned = True
        if self._delay is None:
            return requested
        requested = requested.copy()
        delay = known.physics["action_delay"]
        inputs.action[:] = self._delay.push(requested, delay)
        return requested

    def _position(self, k: int, measured: Array, acts: bool = False) -> None:
        """Move a seat's paddle to its measured position and velocity (B, 4), ego frame.

        Worlds with a row of nan keep the requested action. In all others the action is
        0, unless the driver has commanded its device with it (``acts``).
        """
        self._positioned = True
        action, prescribed = self.inputs.action, self.inputs.prescribed
        if not acts:
            given = np.isfinite(measured[:, :1])
            action[:, k] = np.where(given, 0.0, action[:, k])
        prescribed[:, k, :2] = products(measured[:, :2], self._rotations[k].T)
        prescribed[:, k, 2:] = products(measured[:, 2:], self._rotations[k].T)


class Elimination:
    """Positions of eliminated paddles behind their sides, and their goal lines."""

    def __init__(self, scene: Scene) -> None:
        table, sides = scene.table, [seat.side for seat in scene.seats]
        behind = table.offsets[sides] + 2 * table.paddle_radius
        self.parking = np.zeros((len(sides), 4))
        """Position and velocity of each eliminated paddle, table frame, m and m/s."""
        self.parking[:, :2] = -table.normals[sides] * behind[:, None]
        lines = [line.side for line in scene.goal_lines]
        owners = [sides.index(side) if side in sides else -1 for side in lines]
        self.owner = np.array(owners, np.int64)
        """Seat of each goal line, or -1."""

    def apply(self, eliminated: Array, inputs: Inputs) -> None:
        """Remove the paddles of eliminated seats (B, seats) and close their goals."""
        inputs.action[eliminated], inputs.raised[eliminated] = 0.0, True
        parking = np.broadcast_to(self.parking, inputs.prescribed.shape)
        inputs.prescribed[eliminated] = parking[eliminated]
        inputs.closed[:] = eliminated[:, self.owner] & (self.owner >= 0)
