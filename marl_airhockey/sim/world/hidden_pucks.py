"""Pucks that no seat sees for a time, by the rules of a scenario."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory


class HiddenPucks:
    """Replacement of hidden pucks by their last visible values, in B worlds."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._last: State | None = None

    @staticmethod
    def of(scenario: Scenario, forms: Collection[str]) -> HiddenPucks | None:
        """Return the replacement for a scenario; None if it hides no puck.

        Raises:
            ValueError: An observation type is not "velocity".
        """
        others = ", ".join(sorted({*forms} - {"velocity"}))
        if scenario.hides and others:
            raise ValueError(
                f'observe: {scenario.name} hides pucks; use observe="velocity", not '
                f"{others}"
            )
        return HiddenPucks(scenario) if scenario.hides else None

    def replaced(self, sensed: State, memory: Memory, begun: Array) -> State:
        """Return a sensed state with the last visible values of hidden pucks.

        Args:
            sensed: Sensed state of all worlds.
            memory: Memory of the scenario in all worlds.
            begun: Indices of the worlds (W,) in which an episode begins.
        """
        pucks, last = sensed.bodies.puck, self._last or sensed
        unseen = self._scenario.hidden(sensed, memory)
        unseen[begun] = False
        position, velocity = sensed.position.copy(), sensed.velocity.copy()
        for new, old in ((position, last.position), (velocity, last.velocity)):
            new[:, pucks] = np.where(unseen[..., None], old[:, pucks], new[:, pucks])
        visible = sensed.visible & ~unseen
        self._last = replace(
            sensed, position=position, velocity=velocity, visible=visible
        )
        return self._last
