"""Actions of all seats in a step: open, driven and retired ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.state import State
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.control_step import ControlStep
from marl_airhockey.world.delay import Delay
from marl_airhockey.world.driven_seat import DrivenSeat
from marl_airhockey.world.episode import Episode
from marl_airhockey.world.retired_seats import RetiredSeats


class Actions:
    """Collector of the actions of B worlds, which delays them by the physics.

    Args:
        scenario: says which seats are retired.
        driven: seats with drivers inside.
        open_seats: (open,) indices of the others.
        physics: says how long a delay there can be.
        worlds: B.
        control_dt: s.
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
        self._retired_seats = RetiredSeats(scene)
        self._shape = (worlds, len(open_seats), 2)
        shape = (worlds, len(scene.seats), 2)
        self._delay = Delay(longest, control_dt, shape) if longest else None
        self._prescribes = False
        """True if the last step had prescribed paddles or closed goals."""

    def reset(self, worlds: Array) -> None:
        """Forget the actions that are under way in some worlds, by index."""
        if self._delay is not None:
            self._delay.fill(worlds, 0.0)

    def asked(self, step: ControlStep) -> Array:
        """Return the actions (B, seats, 2) of the step, before their delay."""
        return step.action if self._delay is None else self._delay.newest

    def collect(
        self,
        step: ControlStep,
        actions: Array,
        prescribed: Array | None,
        sensed: State,
        memory: Memory,
        episode: Episode,
    ) -> None:
        """Fill the actions, prescribed motions and closed goals of a step.

        Args:
            step: its ``action``, ``prescribed``, ``closed`` and ``raised`` are filled.
            actions: (B, open, 2) of the open seats.
            prescribed: (B, open, 4) of the open seats, nan where they ask; or None.
            sensed: state that drivers see, table frame.
            memory: of the scenario.
            episode: its counters and physics.

        Raises:
            ValueError: a wrong shape.
        """
        if actions.shape != self._shape:
            raise ValueError(
                f"actions: expected shape {self._shape}, got {actions.shape}"
            )
        if self._prescribes:
            step.prescribed[:], step.closed[:] = np.nan, False
            step.raised[:] = False
            self._prescribes = False
        if not self._driven:
            step.action[:] = actions
        else:
            step.action[:, self._open] = actions
        if prescribed is not None:
            for k, measured in zip(self._open, prescribed.swapaxes(0, 1), strict=True):
                self._prescribe(step, int(k), measured)
        for seat in self._driven:
            measured, k = seat.measured(), seat.index
            if measured is None:
                values, cycles = episode.physics, episode.cycles
                step.action[:, k] = seat.act(sensed, memory, values, cycles)
            else:
                self._prescribe(step, k, measured)
        retired = self._scenario.retired(memory)
        if retired is not None and retired.any():
            seats, self._prescribes = self._retired_seats, True
            seats.retire(
                *(retired, step.action, step.prescribed, step.closed, step.raised)
            )
        if self._delay is not None:
            delay = episode.physics["action_delay"]
            step.action[:] = self._delay.push(step.action, delay)

    def _prescribe(self, step: ControlStep, k: int, measured: Array) -> None:
        """Put a seat's paddle where it was measured, (B, 4), ego frame; nan: it asks.

        What a seat asks for while it prescribes is nothing.
        """
        self._prescribes = True
        given = np.isfinite(measured[:, :1])
        step.action[:, k] = np.where(given, 0.0, step.action[:, k])
        step.prescribed[:, k, :2] = measured[:, :2] @ self._rotations[k]
        step.prescribed[:, k, 2:] = measured[:, 2:] @ self._rotations[k]
