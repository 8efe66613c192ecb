"""Driver contract: the interface of everything that moves a paddle.

There are two kinds. A policy, a script or a mouse requests actions, and the backend
moves the paddle. A position-driven driver, such as a hand under a camera or a robot
with its own controller, measures the position of the paddle, and the backend follows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType, TracebackType
from typing import Any, ClassVar, Self

from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array


@dataclass(frozen=True)
class View:
    """View of one seat in B worlds, as its driver gets it."""

    scene: Scene
    """Seats, bodies and goal lines on the table."""
    state: State
    """Sensed state in the seat's ego frame."""
    read: Callable[[State | None], Array | Mapping[str, Array]]
    """Function that computes the observation of a state like ``state``; of ``state``
    itself for None."""
    labels: tuple[str, ...]
    """Name of each element of a flat observation."""
    top_speed: Array
    """Speed of an action of norm 1 (B,), m/s."""
    reach: Array
    """Corners of the seat's workspace (K, 2), ego frame, m."""
    rng: RandomStreams
    """Random streams of the driver, one for each world."""
    seat: int
    """Index of the seat and of its paddle in ``state``."""
    control_dt: float
    """Time between two actions of the driver, s."""
    scenario_memory: Mapping[str, Array] = field(default_factory=dict)
    """Memory of the scenario (B, *), by name; goals in the table frame."""
    reaction: float = 0.0
    """Latency of ``state`` by the rules of the game, except for the own paddle, s."""

    @cached_property
    def observation(self) -> Array | Mapping[str, Array]:
        """Observation (B, D) of type `observe`; a dictionary with goals="dict"."""
        return self.read(None)


PrescribedMotion = Array
"""Measured position and velocity of a paddle (B, 4), ego frame, m and m/s."""


class Driver:
    """Driver of one seat in B worlds.

    Policies and scripts are pure functions. Everything that they store between steps is
    in the memory: arrays with one row for each world. Environments are copied and
    pickled with their drivers. A driver that owns a device drops it in its
    ``__getstate__``.
    """

    observe: str | None = None
    """Observation type of the driver; None for the type of the environment."""
    control_dt: float | None = None
    """Time between two actions, s, a multiple of the environment's time; None for the
    same time."""
    trained_in: Mapping[str, Any] = MappingProxyType({})
    """Environment in which the policy was trained, as far as it is known, see
    `policies.policy.trained_in`."""
    erratic: ClassVar[bool] = False
    """True for a driver that must never move a real arm."""
    needs_person: ClassVar[bool] = False
    """True for a driver that a person moves with a mouse, a gamepad or a hand."""
    needs_device: ClassVar[bool] = False
    """True for a driver that owns a device: a camera or a robot."""
    commands_device: bool = False
    """True for a position-driven driver whose `act` commands the device that it
    measures. `act` is then called before `measured`, and its action moves nothing
    else."""
    needs_goal: ClassVar[bool] = False
    """True for a driver that can only play a `GoalScenario`."""

    @property
    def trouble(self) -> str:
        """Reason why the paddle rests although a person moves it; "" for none."""
        return ""

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        """Check, before the first step, that the driver can act on observations.

        Args:
            observation: Observations of a few worlds, all zeros.

        Raises:
            ValueError: The driver cannot act on such observations. The message gives
                the reason.
        """

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the memory of ``worlds`` worlds at the start of an episode."""
        return {}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the actions (B, 2), fraction of top speed, and the new memory.

        It is not called for a position-driven driver, unless `commands_device` is True.
        """
        raise NotImplementedError(f"{type(self).__name__} has no act()")

    def measured(self) -> PrescribedMotion | None:
        """Return the measured paddle (B, 4); None if not position-driven."""
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        return None
