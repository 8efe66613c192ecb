"""Driver contract: whatever moves a paddle.

A driver requests an action (policy, script, mouse) and the backend moves the paddle, or
it is position-driven (a hand under a camera, a robot with its own controller): it
measures where the paddle is, and the backend follows.
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
    """View of one seat in B worlds: what its driver knows."""

    scene: Scene
    """Seats, bodies and goal lines on the table."""
    state: State
    """The sensed state, rotated into the seat's ego frame."""
    read: Callable[[], Array | Mapping[str, Array]]
    """Reader of `observation`, so that scripts without one do not pay for it."""
    labels: tuple[str, ...]
    """Name of each element of a flat observation."""
    top_speed: Array
    """(B,) m/s: speed of an action of norm 1."""
    reach: Array
    """(K, 2) corners of the seat's reach, ego frame, m."""
    rng: RandomStreams
    """Random streams of the driver, one for each world."""
    seat: int
    """Index of the seat: its paddle in ``state``."""
    control_dt: float
    """Time between two actions of the driver, s."""
    scenario_memory: Mapping[str, Array] = field(default_factory=dict)
    """Memory of the scenario, (B, *); goals in the table frame."""
    reaction: float = 0.0
    """Latency of ``state`` by the rules of the game, but for the own paddle, s."""

    @cached_property
    def observation(self) -> Array | Mapping[str, Array]:
        """(B, D), or the dict of goals="dict", built with the driver's `observe`."""
        return self.read()


PrescribedMotion = Array
"""(B, 4) measured position and velocity of a paddle, ego frame, m and m/s."""


class Driver:
    """Driver of one seat in B worlds.

    Policies and scripts are pure: what they keep between steps is the memory, arrays
    with one row for each world. Environments are copied and pickled with their drivers;
    one that owns a device drops it in its ``__getstate__``.
    """

    observe: str | None = None
    """Form of the driver's observations; None for the environment's."""
    control_dt: float | None = None
    """Time between two actions, s, a multiple of the environment's; None: the same."""
    trained_in: Mapping[str, Any] = MappingProxyType({})
    """Environment in which its policy was trained, as far as it is known, see
    `policies.policy.trained_in`"""
    erratic: ClassVar[bool] = False
    """True for one that must never move a real arm."""
    needs_person: ClassVar[bool] = False
    """True for one that a person moves, with a mouse, a gamepad or a hand."""
    needs_device: ClassVar[bool] = False
    """True for one that owns a device: a camera, a robot."""
    commands_device: bool = False
    """True for a position-driven one whose `act` commands the device that it measures:
    `act` is then called before `measured`, and its action moves nothing else."""
    needs_goal: ClassVar[bool] = False
    """True for one that can only play a `GoalScenario`."""

    @property
    def trouble(self) -> str:
        """Reason why its paddle rests although somebody moves it; "" for none."""
        return ""

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        """Refuse, before the first step, observations that it cannot act on.

        Args:
            observation: Observations of a few worlds, all zeros.

        Raises:
            ValueError: It cannot act on such observations, with the reason.
        """

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        """Return the memory of W = ``worlds`` worlds whose episode begins."""
        return {}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        """Return the action (B, 2), fractions of top speed, and the memory.

        It is not called of a position-driven one, unless that `commands_device`.
        """
        raise NotImplementedError(f"{type(self).__name__} has no act()")

    def measured(self) -> PrescribedMotion | None:
        """Return the measured paddle (B, 4) if position-driven; None if it requests."""
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
