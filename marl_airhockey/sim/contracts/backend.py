"""Backend contract: paddle commands in, the next state out; B worlds at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.mark import Mark
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import RESULTS, State
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.types import Array

MAX_PRESCRIBED_SPEED = 12.0
"""Speed above which a position-driven paddle is raised and touches nothing, m/s."""

PATIENCE = 0.1
"""Time after which a puck without room beside a position-driven paddle is lifted, s."""
MOMENTS = 10
"""Number of parts of a control step in a path, for backends without physics steps."""


class Command(NamedTuple):
    """Command of the paddles in a step, table frame; preallocated arrays."""

    velocity: Array
    """(B, seats, 2) m/s, reached at the end of the step by a linear ramp"""
    prescribed: Array
    """(B, seats, 4) position and velocity at the end of the step, m and m/s, of
    position-driven paddles; nan for all others"""
    closed: Array
    """(B, goal_lines) bool: wall in this step"""
    raised: Array
    """(B, seats) bool: held above the table, so that it touches nothing"""

    @staticmethod
    def still(scene: Scene, worlds: int) -> Command:
        """Return a command to rest, freshly allocated."""
        seats = len(scene.seats)
        return Command(
            np.zeros((worlds, seats, 2)),
            np.full((worlds, seats, 4), np.nan),
            np.zeros((worlds, len(scene.goal_lines)), np.bool_),
            np.zeros((worlds, seats), np.bool_),
        )


class Backend(ABC):
    """Physics of B worlds with one scene.

    Paddles follow their command and are not pushed back by a puck; one that is not
    position-driven stops at an immovable (pinned) puck. A position-driven one that
    leaves a puck no room for 0.1 s lifts it off the table. A backend can be copied and
    pickled at any moment; the copy is independent.

    Args:
        scene: Scene on the tables.
        num_worlds: Number of worlds, B.
        control_dt: Time of a step, s.
        substeps: Least number of physics steps in it; None for the backend's own.

    Raises:
        ValueError: Substeps for a backend that finds contacts at their moments.
    """

    instant_contacts: ClassVar[bool] = True
    """True if a contact takes no time: an impulse, so bounces have closed forms."""
    tracks_commands: ClassVar[bool] = True
    """True if paddles move exactly as commanded until something stops them. Where they
    do not, an arm moves them: it has parameters of its own, and no servo is simulated
    in addition."""
    timestep: ClassVar[float | None]
    """Longest physics step unless ``substeps`` is given, s; None without such steps."""
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
        """Least number of physics steps in a control step; 0 without such steps."""
        self.moments = self.substeps or MOMENTS
        """Number of equal parts of a control step in a path, which has a row more."""
        self._rest = scene.still_state(num_worlds)
        """State before a `reset`; all states share its `visible`, read-only."""
        self._before = self._rest

    @classmethod
    def _count(cls, control_dt: float, substeps: int | None) -> int:
        if cls.timestep is not None:
            return substeps or int(np.ceil(control_dt / cls.timestep - 1e-9))
        if substeps is not None:
            raise ValueError(
                "substeps: this backend finds every contact at its moment and has no "
                "physics steps; leave it out"
            )
        return 0

    @classmethod
    def available(cls) -> str | None:
        """Return None, or the reason why it cannot run here and the fix."""
        return None

    @classmethod
    def supports(cls, scene: Scene) -> str | None:
        """Return None, or the reason why it cannot play this scene."""
        return None

    @abstractmethod
    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        """Set the parameters of some worlds, by index (W,); values are (B,) each."""

    def key_scatter(self, keys: Array, worlds: Array) -> None:
        """Set the keys (B,), uint64, of the contacts' scatter in some worlds, by index.

        Their collisions are counted from 0 again. Nothing happens in a backend whose
        contacts do not scatter.
        """
        return None

    def reset(self, state: State, worlds: Array) -> None:
        """Reset some worlds, by index (W,), to rows of a state of all B.

        Bodies that touch in the state have touched before: they make no new contact
        and no new crossing. The past of these worlds is forgotten.
        """
        self._before = state

    @abstractmethod
    def stage(self, command: Command, before: State, after: State) -> Stage:
        """Return a step of ``control_dt`` between preallocated states, for all worlds.

        It fills the `RESULTS` of ``after`` (and ``path``, if the scene has one);
        ``before`` is the state that it filled last, or that of a `reset`.
        """

    def step(self, command: Command) -> State:
        """Return the state after a step, freshly allocated.

        For use without a `World`, which runs `stage` on preallocated arrays.
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
        """Return (H, W, 3) uint8 of what one of the `viewpoints` shows of a world.

        Raises:
            RuntimeError: it cannot be drawn here; says what to install.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Free the resources of the backend."""
        return None


class LiveBackend(Backend):
    """Backend of a real table: its states are measured.

    So no sensor, latency, noise or servo is simulated; a step takes as long as it
    lasts; an episode begins with what `arrange` brings about; limits continue from the
    last command, as measured velocities come late. There is one world.
    """

    @classmethod
    @abstractmethod
    def table_and_profile(cls, rig: str) -> tuple[str, str]:
        """Return the names of a rig's table and of its robot's profile.

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
            control_dt: Time of a step, s.
            rig: Path of the file that describes the devices.
            physics: Ranges in which the physics of the table may lie.

        Raises:
            ValueError: The file is wrong, or of another table.
            RuntimeError: A device does not answer, with the remedy.
        """

    @abstractmethod
    def arrange(self, state: State) -> State:
        """Arrange the state in which an episode begins; return the measured state.

        Called after `reset`.

        Raises:
            RuntimeError: It cannot be arranged, with the reason.
        """

    @property
    @abstractmethod
    def interruption(self) -> str:
        """Reason why the running episode cannot continue; "" while it can."""

    @abstractmethod
    def sight(self) -> Array:
        """Return (B, pucks, 4) x, y, m, visibility and age, s, in the newest frame."""

    @abstractmethod
    def telemetry(self) -> dict[str, Any]:
        """Return what the devices report; JSON values.

        The requested command, ``asked``, and the one that was ``sent``, m/s, are
        among them.
        """
