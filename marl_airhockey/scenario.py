"""The scenario contract: who is on the table, how it starts, what is wanted and final.

Scenario functions are pure and vectorised: the same code judges one world, 4096 worlds
and a stored dataset. Leading axes are the caller's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from marl_airhockey import rewards
from marl_airhockey.cast import Cast
from marl_airhockey.draws import Draws
from marl_airhockey.layout import Piece
from marl_airhockey.physics import unknown
from marl_airhockey.state import Array, Memory, State
from marl_airhockey.table import SEAT_KINDS, TABLES, Seat, Table, make_seat


class Mark(NamedTuple):
    """Something to draw on the table that is no body: a goal, a line, an arrow."""

    kind: Literal["circle", "line", "arrow"]
    start: tuple[float, float]
    """Centre or first end, m."""
    end: tuple[float, float] = (0.0, 0.0)
    """Second end, m."""
    radius: float = 0.0
    """m"""

    @staticmethod
    def circle(centre: Array, radius: float) -> Mark:
        """A circle, m."""
        return Mark("circle", (float(centre[0]), float(centre[1])), radius=radius)

    @staticmethod
    def across(table: Table, x: float) -> Mark:
        """A line from one long side to the other, m."""
        wide = float(table.size[1]) / 2
        return Mark("line", (float(x), -wide), (float(x), wide))

    @staticmethod
    def arrow(start: Array, way: Array) -> Mark:
        """An arrow from a point along a way, m."""
        tip = np.asarray(start) + way
        first = (float(start[0]), float(start[1]))
        return Mark("arrow", first, (float(tip[0]), float(tip[1])))


@dataclass(frozen=True, kw_only=True)
class Scenario(ABC):
    """One scenario; its fields are its options.

    Memory holds arrays by name, (..., *); `touches` and `apart` (see
    `rewards.count_touches`) are kept for every scenario with pucks.
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
            raise ValueError(unknown("kind of seats", self.seats, SEAT_KINDS))
        if self.table not in TABLES:
            raise ValueError(unknown("table", self.table, TABLES))
        if self.goals not in ("flat", "dict"):
            raise ValueError(unknown("form of goals", self.goals, ("flat", "dict")))
        for f in fields(self):
            _check_number(f.name, f.type, getattr(self, f.name))
        if self.seconds == 0:
            raise ValueError("seconds: must be above 0")
        if self.goals == "dict" and not isinstance(self, GoalScenario):
            raise ValueError('goals="dict": this scenario has no wanted goal')

    @property
    @abstractmethod
    def cast(self) -> Cast:
        """Seats, bodies and mouths."""

    @abstractmethod
    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        """First states and memories of ``worlds`` worlds, one row each."""

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        """What changes in the memory by a step.

        ``memory`` holds the new touches already, all else as it was before the step. An
        event that happens once needs a flag of its own, ``old | now``.
        """
        return {}

    @property
    @abstractmethod
    def observation(self) -> tuple[Piece, ...]:
        """What a seat is shown."""

    @abstractmethod
    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        """Named terms, (..., seats) each; the reward is their sum."""

    def terminated(self, after: State, memory: Memory) -> Array:
        """(...) bool: the episode ended for a reason inside the game."""
        return np.zeros(after.time.shape, np.bool_)

    def restart(
        self, draws: Draws, after: State, memory: Memory
    ) -> tuple[Array, State, Memory] | None:
        """Serve again inside an episode, for games that go on after a goal.

        Returns None, or some of the worlds, by index (W,), and rows for them.
        """
        return None

    def retired(self, memory: Memory) -> Array | None:
        """(..., seats) bool: who is out of the game; None where nobody ever is.

        Their paddles stand behind their sides, whose goal mouths are wall.
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

    def advance(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        """The memory after a step: touches, then what the scenario counts."""
        new = dict(memory)
        if after.bodies.pucks:
            new.update(rewards.count_touches(memory, before, after))
        new.update(self.remember(new, before, sent, after))
        return new

    def judge(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        """All reward terms, the regularising ones included, (..., seats) each."""
        if self.goals == "dict":
            return {"goal": self.met(after, new)[..., None].astype(np.float64)}
        terms = self.reward_terms(before, sent, after, old, new)
        if self.jitter_weight:
            top = self.cast.seats[0].speed
            cost = rewards.jitter(before, sent, top)
            terms["jitter"] = -self.jitter_weight * cost
        if self.turn_weight:
            terms["turn"] = -self.turn_weight * rewards.turning(before, sent)
        return terms

    def ends(self, after: State, memory: Memory) -> Array:
        """(...) bool: `terminated`; with goals="dict" only a met goal ends it."""
        if self.goals == "dict":
            return self.met(after, memory)
        return self.terminated(after, memory)

    def succeeds(self, after: State, memory: Memory) -> Array:
        """`success`; with goals="dict" it is that the goal is met."""
        if self.goals == "dict":
            return self.met(after, memory)
        return self.success(after, memory)

    def met(self, after: State, memory: Memory) -> Array:
        """(...) bool: the wanted goal is met at this state, judged by goals alone."""
        raise NotImplementedError(f"{type(self).__name__} has no wanted goal")

    def scan(self, memory: Memory, states: State, sent: Array) -> Memory:
        """Fold `advance` over a recording.

        Args:
            memory: at the start, (...).
            states: (T + 1, ...) states.
            sent: (T, ..., seats, 2) velocities.

        Returns:
            The memories (T + 1, ...), the first being ``memory``.
        """
        all_of = [memory]
        for t in range(len(sent)):
            before = states.map(lambda x, t=t: x[t])  # type: ignore[misc]
            after = states.map(lambda x, t=t: x[t + 1])  # type: ignore[misc]
            all_of.append(self.advance(all_of[-1], before, sent[t], after))
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

    def met(self, after: State, memory: Memory) -> Array:
        reward = self.goal_reward(self.achieved(after, memory), self.desired(memory))
        met: Array = reward > 0
        return met
