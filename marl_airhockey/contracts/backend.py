"""The backend contract: paddle commands in, the next state out; B worlds at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import RESULTS, State, still_state
from marl_airhockey.jit.pipeline import NotCompilable, Stage
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.contracts.mark import Mark

MAX_PRESCRIBED_SPEED = 5.0
"""m/s: a prescribed paddle that must be faster than this is lifted, without contact."""


@dataclass(frozen=True)
class Command:
    """What the paddles do in a step, table frame."""

    velocity: Array
    """(B, seats, 2) m/s to be reached at the end of the step by a linear ramp"""
    prescribed: Array | None = None
    """(B, seats, 4) position and velocity at the end of the step, nan where a seat
    asks; None if all do"""
    closed: Array | None = None
    """(B, goal_lines) goal lines that are wall in this step; None if none is"""


class Backend(ABC):
    """Physics of B worlds with one scene.

    Paddles track their command and are not pushed back by a puck.

    Args:
        scene: who is on the table.
        num_worlds: B.
        control_dt: s of a step.
        substeps: physics steps in it.
    """

    exact: ClassVar[bool]
    """True if row i does not depend on the number of worlds, to the bit."""
    ideal: ClassVar[bool] = True
    """True if paddles move exactly as they are prescribed and contacts take no time."""
    realtime: ClassVar[bool] = False
    """True if a step takes as long as it lasts."""
    default_substeps: ClassVar[int]
    cameras: ClassVar[tuple[str, ...]] = ()
    """Names of views that it can take pictures from."""

    def __init__(
        self, scene: Scene, num_worlds: int, control_dt: float, substeps: int
    ) -> None:
        self.scene, self.num_worlds = scene, num_worlds
        self.control_dt, self.substeps = control_dt, substeps
        self.rest_state = still_state(scene.bodies, num_worlds, len(scene.goal_lines))
        """All at rest. States share its arrays of what they have nothing to say about;
        nobody writes to them."""
        self._nobody = np.zeros((num_worlds, scene.bodies.paddles), np.bool_)
        self._open = np.zeros((num_worlds, len(scene.goal_lines)), np.bool_)
        moments = substeps + 1 if scene.path else 0
        self._path_shape = (num_worlds, moments, scene.bodies.movers, 4)

    @classmethod
    def available(cls) -> str | None:
        """None, or the reason why this backend cannot run here and the fix."""
        return None

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        """None, or the reason why this backend cannot play this scene."""
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
        """How fast seats go (B, seats, 2), who of them is prescribed, and who is lifted."""
        if command.prescribed is None:
            return command.velocity, self._nobody, self._nobody
        prescribed = np.asarray(np.isfinite(command.prescribed).all(-1))
        way = command.prescribed[..., :2] - position[:, : prescribed.shape[1]]
        way /= self.control_dt
        lifted = prescribed & (
            np.hypot(way[..., 0], way[..., 1]) > MAX_PRESCRIBED_SPEED
        )
        return (
            np.where(prescribed[..., None], way, command.velocity),
            prescribed,
            lifted,
        )

    def empty_state(self) -> State:
        """A state with arrays of its own, of any content, of what steps change."""
        fields: dict[str, Array] = {
            name: np.empty_like(getattr(self.rest_state, name)) for name in RESULTS
        }
        if self.scene.path:
            fields["path"] = np.empty(self._path_shape)
        return self.rest_state.replaced(fields)

    def stage(self, goal: Array, before: State, after: State) -> Stage:
        """A step from one state that stays into another, for a chain.

        Args:
            goal: (B, seats, 2) m/s, where all ask.
            before: the step.
            after: the step; its motion and events are filled.

        Raises:
            Unchained: a step is not one compiled function.
        """
        raise NotCompilable(f"{type(self).__name__} has no compiled step")

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
