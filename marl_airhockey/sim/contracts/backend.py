"""Backend contract: computes the next state of B worlds from paddle commands."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.camera_model import CameraModel
from marl_airhockey.sim.contracts.mark import Mark
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import RESULTS, State
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.types import Array

MAX_PRESCRIBED_SPEED = 12.0
"""Speed above which a position-driven paddle is raised and touches nothing, m/s."""

PATIENCE = 0.1
"""Time after which a puck without space at a position-driven paddle is lifted, s."""
MOMENTS = 10
"""Number of parts of a control step in a path, for backends without physics steps."""


class Command(NamedTuple):
    """Command of the paddles in a step, table frame, in preallocated arrays."""

    velocity: Array
    """Velocities at the end of the step (B, seats, 2), m/s. The velocity is a linear
    ramp."""
    prescribed: Array
    """Positions and velocities of position-driven paddles at the end of the step
    (B, seats, 4), m and m/s; nan for all others."""
    closed: Array
    """True for goal lines that are walls in this step (B, goal_lines)."""
    raised: Array
    """True for paddles that are held above the table and touch nothing (B, seats)."""

    @staticmethod
    def still(scene: Scene, worlds: int) -> Command:
        """Return a command that lets all paddles rest, freshly allocated."""
        seats = len(scene.seats)
        return Command(
            np.zeros((worlds, seats, 2)),
            np.full((worlds, seats, 4), np.nan),
            np.zeros((worlds, len(scene.goal_lines)), np.bool_),
            np.zeros((worlds, seats), np.bool_),
        )


class Backend(ABC):
    """Physics of B worlds with one scene.

    Paddles follow their command, and pucks do not push them back. A paddle that is not
    position-driven stops at an immovable (pinned) puck. If a position-driven paddle
    leaves a puck no space for 0.1 s, the puck is lifted off the table. A backend can be
    copied and pickled at any time. The copy is independent.

    Args:
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        control_dt: Length of a control step, s.
        substeps: Smallest number of physics steps in a control step; None for the
            default of the backend.

    Raises:
        ValueError: `substeps` is given, but the backend has no physics steps.
    """

    instant_contacts: ClassVar[bool] = True
    """True if a contact is an impulse that takes no time. Bounces then have closed
    forms."""
    tracks_commands: ClassVar[bool] = True
    """True if paddles move exactly as commanded until something stops them. Otherwise
    an arm moves them. The arm has its own parameters, and no servo is simulated in
    addition."""
    timestep: ClassVar[float | None]
    """Longest physics step unless ``substeps`` is given, s; None for a backend without
    physics steps."""
    viewpoints: ClassVar[tuple[str, ...]] = ()
    """Names of the viewpoints of `photograph`."""

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        control_dt: float,
        substeps: int | None = None,
    ) -> None:
        self.scene, self.num_worlds = scene, num_worlds
        self.control_dt = control_dt
        self.substeps = self._count(control_dt, substeps)
        """Smallest number of physics steps in a control step; 0 if there are none."""
        self.moments = self.substeps or MOMENTS
        """Number of equal parts of a control step in a path, which has one row more."""
        self._rest = scene.still_state(num_worlds)
        """State before a `reset`. All states share its `visible`, read-only."""
        self._before = self._rest

    @classmethod
    def _count(cls, control_dt: float, substeps: int | None) -> int:
        if cls.timestep is not None:
            return substeps or int(np.ceil(control_dt / cls.timestep - 1e-9))
        if substeps is not None:
            raise ValueError(
                "substeps: this backend computes the time of every contact and has no "
                "physics steps: omit substeps"
            )
        return 0

    @classmethod
    def available(cls) -> str | None:
        """Return None, or the reason why the backend cannot run here, with a remedy."""
        return None

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        """Return None, or the reason why the backend cannot play a scene."""
        return None

    @abstractmethod
    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        """Set the parameters of some worlds.

        Args:
            values: Values (B,) of the parameters, by name.
            worlds: Indices (W,) of the worlds.
        """

    def key_scatter(self, keys: Array, worlds: Array) -> None:
        """Set the keys of the contact noise in some worlds.

        Their collisions are counted from 0 again. A backend without contact noise does
        nothing.

        Args:
            keys: Keys (B,), uint64.
            worlds: Indices (W,) of the worlds.
        """
        return None

    def reset(self, state: State, worlds: Array) -> None:
        """Reset some worlds, by index (W,), to rows of a state of all B worlds.

        Bodies that touch in the state count as in contact before. They make no new
        contact and no new crossing. The past of these worlds is deleted.
        """
        self._before = state

    @abstractmethod
    def stage(self, command: Command, before: State, after: State) -> Stage:
        """Return the stage of a control step of all worlds, on preallocated states.

        It fills the `RESULTS` of ``after``, and its ``path`` if the scene has one.
        ``before`` is the state that it filled last, or the state of a `reset`.
        """

    def step(self, command: Command) -> State:
        """Return the state after a step, freshly allocated.

        It is for use without a `World`, which runs `stage` on preallocated arrays.
        """
        after = self.empty_state()
        self.stage(command, self._before, after)()
        self._before = after
        return after

    def empty_state(self) -> State:
        """Return a state whose `RESULTS` and ``path`` are freshly allocated."""
        fields = {n: np.zeros_like(getattr(self._rest, n)) for n in RESULTS}
        path = None
        if self.scene.path:
            rows, movers = self.moments + 1, self.scene.bodies.movers
            path = np.zeros((self.num_worlds, rows, movers, 4))
        bodies, visible = self.scene.bodies, self._rest.visible
        return State(bodies=bodies, visible=visible, path=path, **fields)

    def photograph(
        self, world: int, viewpoint: str, marks: Sequence[Mark], width: int
    ) -> Array:
        """Return an image (H, W, 3) uint8 of a world from one of the `viewpoints`.

        Raises:
            RuntimeError: The image cannot be rendered here. The message names what to
                install.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Free the resources of the backend."""
        return None


class LiveBackend(Backend):
    """Backend of a real table, whose states are measured.

    There is one world, and a step takes real time. No sensor, latency, noise or servo
    is simulated. An episode begins with the state that `arrange` returns. The limits
    continue from the last command, because measured velocities are delayed.
    """

    @classmethod
    @abstractmethod
    def table_and_profile(cls, rig: str) -> tuple[str, str]:
        """Return the names of the table and the robot's profile in a rig file.

        Raises:
            ValueError: The file cannot be read.
        """

    @classmethod
    @abstractmethod
    def open(
        cls, scene: Scene, control_dt: float, rig: str, physics: Physics
    ) -> LiveBackend:
        """Open the devices of a table and return its backend.

        Args:
            scene: Scene on the table.
            control_dt: Length of a control step, s.
            rig: Path of the file that describes the devices.
            physics: Ranges of the physics parameters of the table.

        Raises:
            ValueError: The file is not valid, or describes another table.
            RuntimeError: A device does not respond. The message contains a remedy.
        """

    @abstractmethod
    def arrange(self, state: State) -> State:
        """Arrange the state in which an episode begins; return the measured state.

        It is called after `reset`.

        Raises:
            RuntimeError: The state cannot be arranged. The message gives the reason.
        """

    @property
    @abstractmethod
    def interruption(self) -> str:
        """Reason why the running episode cannot continue; "" while it can."""

    @abstractmethod
    def sight(self) -> Array:
        """Return the pucks in the newest frame (B, pucks, 4).

        The columns are x and y, m, visibility, and age, s.
        """

    @property
    @abstractmethod
    def camera_model(self) -> CameraModel:
        """Model of the camera above the table."""

    @abstractmethod
    def frame(self, size: int) -> Array:
        """Return the newest frame in the window of the model.

        Args:
            size: Width and height of the result, px.

        Returns:
            Image (size, size, 3) uint8, RGB; black beyond the edge of the frame.

        Raises:
            RuntimeError: There is no frame. The message gives the reason.
        """

    @abstractmethod
    def telemetry(self) -> dict[str, Any]:
        """Return the reports of the devices as JSON values.

        They include the commanded velocity, ``asked``, and the velocity that was
        ``sent`` to the robot, m/s.
        """
