"""The scenario contract: who is on the table, how it starts, what is wanted and final.

Scenario functions are pure and vectorised: the same code judges one world, 4096 worlds
and a stored dataset. Leading axes are the caller's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.contracts.observable import Observable
from marl_airhockey.core.errors import unknown_name
from marl_airhockey.core.geometry import length
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import SEAT_KINDS, Seat, make_seat
from marl_airhockey.core.state import State
from marl_airhockey.core.table import TABLES, Table
from marl_airhockey.core.touches import count_touches
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Scenario(ABC):
    """One scenario; its fields are its options.

    Memory holds arrays by name, (..., *); `touches` and `apart` (see
    `touches.count_touches`) are kept for every scenario with pucks.
    """

    seats: str = "robot"
    """Kind of the seats: "robot" (what a UR5e can do) or "arcade"."""
    table: str = "standard"
    """Table preset."""
    goals: str = "flat"
    """"dict" shows wanted and achieved goals apart, as HER needs them."""
    jitter_weight: float = 0.01
    """Cost of a squared change of the sent velocity, in top speeds."""
    turn_weight: float = 0.0
    """Cost of a sudden change of direction."""

    seconds: float
    """Length of an episode, s."""

    version: ClassVar[int] = 0
    """Raised whenever the numbers of the scenario change: the v of its gymnasium id."""

    def __post_init__(self) -> None:
        if self.seats not in SEAT_KINDS:
            raise ValueError(unknown_name("kind of seats", self.seats, SEAT_KINDS))
        if self.table not in TABLES:
            raise ValueError(unknown_name("table", self.table, TABLES))
        if self.goals not in ("flat", "dict"):
            raise ValueError(
                unknown_name("form of goals", self.goals, ("flat", "dict"))
            )
        for f in fields(self):
            _check_number(f.name, f.type, getattr(self, f.name))
        if self.seconds == 0:
            raise ValueError("seconds: must be above 0")
        if self.goals == "dict" and not isinstance(self, GoalScenario):
            raise ValueError('goals="dict": this scenario has no wanted goal')

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Seats, bodies and goal lines."""

    @abstractmethod
    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        """First states and memories of ``worlds`` worlds, one row each."""

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        """What changes in the memory by a step.

        ``memory`` holds the new touches already, all else as it was before the step. An
        event that happens once needs a flag of its own, ``old | now``.
        """
        return {}

    @property
    @abstractmethod
    def observation(self) -> tuple[Observable, ...]:
        """What a seat is shown."""

    @abstractmethod
    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        """Named terms, (..., seats) each; the reward is their sum."""

    def terminated(self, after: State, memory: Memory) -> Array:
        """(...) bool: the episode ended for a reason inside the game."""
        return np.zeros(after.time.shape, np.bool_)

    def restart(
        self, rng: RandomStreams, after: State, memory: Memory
    ) -> tuple[Array, State, Memory] | None:
        """Serve again inside an episode, for games that go on after a goal.

        Returns None, or some of the worlds, by index (W,), and rows for them.
        """
        return None

    def retired(self, memory: Memory) -> Array | None:
        """(..., seats) bool: who is out of the game; None where nobody ever is.

        Their paddles stand behind their sides, whose goal lines are wall.
        """
        return None

    @abstractmethod
    def success(self, after: State, memory: Memory) -> Array:
        """(...) or (..., seats) bool: what a paper reports; latched per episode."""

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        """What to draw for one world, leading axes gone."""
        return []

    def caption(self, memory: Memory) -> str:
        """The score of one world in a few words."""
        touches = memory.get("touches")
        return "" if touches is None else f"touches {int(touches.sum())}"

    # What follows is shared by all scenarios and not meant to be replaced.

    @property
    def name(self) -> str:
        """The name of the file that the scenario comes from."""
        return type(self).__module__.rpartition(".")[2]

    @cached_property
    def table_geometry(self) -> Table:
        """The table that the option names."""
        return TABLES[self.table]

    def seat(self, side: int = 0, others: tuple[int, ...] = (), team: int = 0) -> Seat:
        """A seat of the chosen kind at a side of the table."""
        return make_seat(self.seats, self.table_geometry, side, others, team)

    def next_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        """The memory after a step: touches, then what the scenario counts."""
        new = dict(memory)
        if after.bodies.pucks:
            new.update(count_touches(memory, before, after))
        new.update(self.update_memory(new, before, command, after))
        return new

    def all_reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        """All reward terms, the regularising ones included, (..., seats) each."""
        if self.goals == "dict":
            return {"goal": self.goal_met(after, new)[..., None].astype(np.float64)}
        terms = self.reward_terms(before, command, after, old, new)
        if self.jitter_weight:
            top = self.scene.seats[0].speed
            cost = jitter(before, command, top)
            terms["jitter"] = -self.jitter_weight * cost
        if self.turn_weight:
            terms["turn"] = -self.turn_weight * turning(before, command)
        return terms

    def is_terminated(self, after: State, memory: Memory) -> Array:
        """(...) bool: `terminated`; with goals="dict" only a met goal ends it."""
        if self.goals == "dict":
            return self.goal_met(after, memory)
        return self.terminated(after, memory)

    def is_success(self, after: State, memory: Memory) -> Array:
        """`success`; with goals="dict" it is that the goal is met."""
        if self.goals == "dict":
            return self.goal_met(after, memory)
        return self.success(after, memory)

    def goal_met(self, after: State, memory: Memory) -> Array:
        """(...) bool: the wanted goal is met at this state, judged by goals alone."""
        raise NotImplementedError(f"{type(self).__name__} has no wanted goal")

    def replay_memory(self, memory: Memory, states: State, command: Array) -> Memory:
        """Fold `advance` over a recording.

        Args:
            memory: at the start, (...).
            states: (T + 1, ...) states.
            command: (T, ..., seats, 2) velocities.

        Returns:
            The memories (T + 1, ...), the first being ``memory``.
        """
        all_of = [memory]
        for t in range(len(command)):
            before = states.map(lambda x, t=t: x[t])  # type: ignore[misc]
            after = states.map(lambda x, t=t: x[t + 1])  # type: ignore[misc]
            all_of.append(self.next_memory(all_of[-1], before, command[t], after))
        return {name: np.stack([m[name] for m in all_of]) for name in memory}


def _check_number(name: str, kind: object, value: object) -> None:
    """Refuse what is no sane number where a field holds one."""
    if kind not in ("int", "float"):
        return
    if isinstance(value, (tuple, list)):
        raise ValueError(
            f"{name}: {value!r} is a range; rules and geometry are fixed when built, "
            "only physics can be drawn per episode"
        )
    whole = kind == "int"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name}: expected a number, got {value!r}")
    least = 1 if whole else 0
    if not (np.isfinite(value) and value >= least) or (whole and value != int(value)):
        words = "a whole number of at least 1" if whole else "a number of at least 0"
        raise ValueError(f"{name}: {value!r} must be {words}")


class GoalScenario(Scenario):
    """A scenario with a wanted goal, which can be relabelled afterwards."""

    @property
    @abstractmethod
    def goal_bounds(self) -> tuple[float, ...]:
        """Largest magnitude of each number of a goal."""

    @abstractmethod
    def achieved(self, state: State, memory: Memory) -> Array:
        """(..., goal) what was achieved at this state."""

    @abstractmethod
    def desired(self, memory: Memory) -> Array:
        """(..., goal) what is wanted."""

    @abstractmethod
    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        """(...) 1 where the goal is met, else 0; of goals alone."""

    def goal_met(self, after: State, memory: Memory) -> Array:
        reward = self.goal_reward(self.achieved(after, memory), self.desired(memory))
        goal_met: Array = reward > 0
        return goal_met


def jitter(before: State, command: Array, top_speed: Array | float) -> Array:
    """(..., seats) squared change of the sent velocity, in top speeds."""
    change = (command - before.paddle_velocity) / top_speed
    x, y = change[..., 0], change[..., 1]
    squared: Array = x * x + y * y
    return squared


def turning(before: State, command: Array) -> Array:
    """(..., seats) sudden change of direction: 0 straight on, 1 for a reversal."""
    old = before.paddle_velocity
    size = length(old) * length(command)
    along = (old * command).sum(-1)
    return np.where(size > 1e-6, 0.5 * (1 - along / np.maximum(size, 1e-6)), 0.0)
