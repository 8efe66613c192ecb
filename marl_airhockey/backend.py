"""The backend contract: paddle commands in, the next state out; B worlds at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from marl_airhockey.cast import Cast
from marl_airhockey.chain import Stage, Unchained
from marl_airhockey.state import RESULTS, Array, State, still_state

if TYPE_CHECKING:
    from marl_airhockey.scenario import Mark

TOLD_SPEED = 5.0
"""m/s: a told paddle that must be faster than this is lifted, without contact."""


@dataclass(frozen=True)
class Command:
    """What the paddles do in a step, table frame."""

    velocity: Array
    """(B, seats, 2) m/s to be reached at the end of the step by a linear ramp"""
    told: Array | None = None
    """(B, seats, 4) position and velocity at the end of the step, nan where a seat
    asks; None if all do"""
    shut: Array | None = None
    """(B, mouths) goal mouths that are wall in this step; None if none is"""


class Backend(ABC):
    """Physics of B worlds with one cast.

    Paddles track their command and are not pushed back by a puck.

    Args:
        cast: who is on the table.
        num_worlds: B.
        control_dt: s of a step.
        substeps: physics steps in it.
    """

    exact: ClassVar[bool]
    """True if row i does not depend on the number of worlds, to the bit."""
    ideal: ClassVar[bool] = True
    """True if paddles move exactly as they are told and contacts take no time."""
    realtime: ClassVar[bool] = False
    """True if a step takes as long as it lasts."""
    default_substeps: ClassVar[int]
    cameras: ClassVar[tuple[str, ...]] = ()
    """Names of views that it can take pictures from."""

    def __init__(
        self, cast: Cast, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        self.cast, self.num_worlds = cast, num_worlds
        self.control_dt, self.substeps = control_dt, substeps
        self.quiet = still_state(cast.bodies, num_worlds, len(cast.mouths))
        """All at rest. States share its arrays of what they have nothing to say about;
        nobody writes to them."""
        self._nobody = np.zeros((num_worlds, cast.bodies.paddles), np.bool_)
        self._open = np.zeros((num_worlds, len(cast.mouths)), np.bool_)
        moments = substeps + 1 if cast.path else 0
        self._path_shape = (num_worlds, moments, cast.bodies.movers, 4)

    @classmethod
    def available(cls) -> str | None:
        """None, or the reason why this backend cannot run here and the fix."""
        return None

    @classmethod
    def supports(cls, cast: Cast) -> str | None:
        """None, or the reason why this backend cannot play this cast."""
        return None

    @abstractmethod
    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        """Set the parameters of some worlds, by index (W,); values are (B,) each."""

    @abstractmethod
    def start(self, state: State, worlds: Array) -> None:
        """Go on from ``state`` (of all B worlds); some, by index (W,), start anew."""

    @abstractmethod
    def step(self, command: Command) -> State:
        """Move all worlds by ``control_dt``; ``time`` counts from the last start.

        The arrays of the state are its own, or those of `quiet`.
        """

    def _follow(self, command: Command, position: Array) -> tuple[Array, Array, Array]:
        """How fast seats go (B, seats, 2), who of them is told, and who is lifted."""
        if command.told is None:
            return command.velocity, self._nobody, self._nobody
        told = np.asarray(np.isfinite(command.told).all(-1))
        way = command.told[..., :2] - position[:, : told.shape[1]]
        way /= self.control_dt
        lifted = told & (np.hypot(way[..., 0], way[..., 1]) > TOLD_SPEED)
        return np.where(told[..., None], way, command.velocity), told, lifted

    def blank(self) -> State:
        """A state with arrays of its own, of any content, of what steps change."""
        fields: dict[str, Array] = {
            name: np.empty_like(getattr(self.quiet, name)) for name in RESULTS
        }
        if self.cast.path:
            fields["path"] = np.empty(self._path_shape)
        return self.quiet.having(fields)

    def stage(self, goal: Array, before: State, after: State) -> Stage:
        """A step from one state that stays into another, for a chain.

        Args:
            goal: (B, seats, 2) m/s, where all ask.
            before: the step.
            after: the step; its motion and events are filled.

        Raises:
            Unchained: a step is not one compiled function.
        """
        raise Unchained(f"{type(self).__name__} has no compiled step")

    def begin(self) -> None:
        """What is to be done before a stage."""
        return None

    def finish(self, goal: Array, after: State) -> None:
        """What is left to be done after a stage: the worlds are in ``after`` now."""
        return None

    def photograph(
        self, world: int, camera: str, marks: Sequence[Mark], width: int
    ) -> Array:
        """(H, W, 3) uint8 of what one of the `cameras` sees of a world.

        Raises:
            RuntimeError: it cannot be drawn here; says what to install.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Let go of whatever the backend holds."""
        return None
