"""Scenario contract: scene, initial states, goals, rewards and ends of episodes.

Scenario functions are pure and vectorised: the same code serves one world, 4096 worlds
and a stored dataset. Leading axes are the caller's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, final

import numpy as np

from marl_airhockey.sim.contracts.mark import Mark, Meaning
from marl_airhockey.sim.contracts.observable import Observable
from marl_airhockey.sim.contracts.options import check_places, checked_options
from marl_airhockey.sim.contracts.units import Latency, Seconds, Weight
from marl_airhockey.sim.core.geometry import length
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import Seat, make_seat
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import TABLES, Obstacle, Table
from marl_airhockey.sim.core.touches import count_touches, no_touches
from marl_airhockey.types import Array, Memory


class Transition(NamedTuple):
    """One control step, as the functions of a scenario get it; leading axes (...)."""

    before: State
    command: Array
    """(..., seats, 2) velocity that the limits passed, m/s, table frame"""
    after: State
    memory: Memory
    """Memory of before the step"""
    new_memory: Memory
    """Memory of after the step"""
    time_limit_reached: Array
    """(...) bool: the clock ends the episode with this step"""


@dataclass(frozen=True, kw_only=True)
class Scenario(ABC):
    """Scenario whose fields are its options.

    Memory holds arrays by name, (..., *); `touches` and `apart` (see
    `touches.count_touches`) are kept for every scenario with pucks.
    """

    seats: str = "robot"
    """Kind of the seats: "robot" (limits of a UR5e) or "arcade"."""
    table: str = "standard"
    """Table preset."""
    goals: str = "flat"
    """"dict" shows desired and achieved goals separately, as HER needs them."""
    rules: str = "own"
    """"paper" judges by the published code of the paper: `paper_success`."""
    obstacles: tuple[tuple[float, ...], ...] = ()
    """Obstacles on the table: discs x, y, radius, or bars x, y, radius, x2, y2 between
    two points (m)."""
    reward_regions: tuple[tuple[float, ...], ...] = ()
    """Discs x, y, radius (m) and what they pay per second to a seat whose paddle's
    centre is inside; below 0 for regions to avoid."""
    drag_regions: tuple[tuple[float, ...], ...] = ()
    """Discs x, y, radius (m) and the linear drag (1/s) that is added to the puck's
    while its centre is inside, from one control step to the next."""
    jitter_weight: Weight = 0.01
    """Cost of a squared change of the commanded velocity, in top speeds."""
    turning_weight: Weight = 0.0
    """Cost of a sudden change of direction."""
    reaction: Latency = 0.0
    """Latency with which seats observe pucks and other paddles, in whole control steps
    (s), in addition to that of the profile's sensing."""

    seconds: Seconds
    """Length of an episode, s."""

    announced: ClassVar[tuple[str, ...]] = ()
    """Names of the arrays of the memory that seats know from the referee, such as a
    score; under simulated sensing they know all others from what they sense."""
    version: ClassVar[int] = 0
    """Raised whenever the numbers of the scenario change: the v of its gymnasium id."""

    def __post_init__(self) -> None:
        for name, value in checked_options(self).items():
            object.__setattr__(self, name, value)
        check_places(self, self.scene.table)
        if self.obstacles and not self.scene.obstacles:
            raise ValueError("obstacles: this scenario's own table takes none")
        if self.goals == "dict" and not isinstance(self, GoalScenario):
            raise ValueError('goals="dict": this scenario has no desired goal')
        if self.rules == "paper":
            if type(self).paper_success is Scenario.paper_success:
                raise ValueError('rules="paper": not one of the ten tasks of the paper')
            if self.goals == "dict":
                raise ValueError('rules="paper": with goals="dict" the goal decides')
        if self.goals == "dict" and self.reaction:
            raise ValueError('reaction: with goals="dict" seats see goals at once')

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Seats, bodies and goal lines."""

    @abstractmethod
    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        """Sample initial states and memories of ``worlds`` worlds, one row each."""

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        """Return the memory of an episode that begins in given states, one row each.

        An episode can begin with any state: of `reset`, of `set_state`, of a recording,
        of a real table. Scenarios add their own arrays to what this returns.
        """
        return no_touches(state) if state.bodies.pucks else {}

    def finalize_goals(
        self,
        rng: RandomStreams,
        state: State,
        memory: Memory,
        physics: Mapping[str, Array],
    ) -> Memory:
        """Return the memory of an episode with goals that depend on its physics.

        Called after `reset` and `initial_memory`; most scenarios keep the default.
        ``physics`` holds the parameters of the episode by name, (W,) each.
        """
        return memory

    def update_memory(self, t: Transition) -> Memory:
        """Return the arrays of the memory that a step changes.

        ``t.memory`` is that before the step, ``t.new_memory`` the same with the new
        touches. An event that happens once needs a flag of its own, ``old | now``.
        """
        return {}

    @property
    @abstractmethod
    def observation(self) -> tuple[Observable, ...]:
        """Observables of a seat, concatenated in this order."""

    @abstractmethod
    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return named terms, (..., seats) each; the reward is their sum."""

    def terminated(self, t: Transition) -> Array:
        """(...) bool: the episode ended for a reason inside the game."""
        return np.zeros(t.after.time.shape, np.bool_)

    def needs_serve(self, t: Transition) -> Array | None:
        """(...) bool: a puck is to be served after the step; None if never."""
        return None

    def serve(
        self, rng: RandomStreams, state: State, memory: Memory
    ) -> tuple[State, Memory]:
        """Serve a puck; the rows are those of the worlds that need it.

        They are copies, which may be changed and returned.
        """
        raise NotImplementedError(f"{type(self).__name__} serves no puck")

    def eliminated(self, memory: Memory) -> Array | None:
        """(..., seats) bool: the seat is eliminated; None where none ever is.

        Their paddles are behind their sides, whose goal lines become walls.
        """
        return None

    @abstractmethod
    def success(self, t: Transition) -> Array:
        """(...) or (..., seats) bool: the success that is reported; latched."""

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: the success of the paper's published code at this step.

        From github.com/CalCharles/air-hockey-rl, commits aee389d and 747580d, whose x
        has the opposite sign. With rules="paper" it replaces `success`, also in the
        rewards, and ends the episode.
        """
        raise NotImplementedError(f"{type(self).__name__} is not a task of the paper")

    def targets(self, memory: Memory) -> Array | None:
        """(W, n, 2) points that obstacles must leave free; None if there are none."""
        return None

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        """Return what to draw for one world, leading axes gone."""
        return []

    def scores(self, memory: Memory) -> dict[str, Array]:
        """Return what one world's game counts, by name: by team or seat, or for all."""
        touches = memory.get("touches")
        return {} if touches is None else {"touches": touches.sum()}

    def caption(self, memory: Memory) -> str:
        """Return the score of one world in a few words."""
        return ", ".join(
            f"{name} " + " : ".join(f"{count:.0f}" for count in np.ravel(counts))
            for name, counts in self.scores(memory).items()
        )

    def decided_by(self, memory: Memory) -> str:
        """Return by what one world's game is decided; "" if by nothing."""
        return ""

    @final
    @property
    def name(self) -> str:
        """Name of the file that the scenario comes from."""
        return type(self).__module__.rpartition(".")[2]

    @cached_property
    def table_geometry(self) -> Table:
        """Table of the option ``table``, with the obstacles."""
        return self.furnished(TABLES[self.table])

    @final
    def furnished(self, table: Table) -> Table:
        """Return a table with the obstacles on it."""
        posts = [
            Obstacle((x, y), radius, (end[0], end[1]) if end else None)
            for x, y, radius, *end in self.obstacles
        ]
        return replace(table, obstacles=tuple(posts))

    @final
    def seat(self, side: int = 0, others: tuple[int, ...] = (), team: int = 0) -> Seat:
        """Return a seat of the chosen kind at a side of the table."""
        return make_seat(self.seats, self.table_geometry, side, others, team)

    @final
    def next_memory(self, t: Transition) -> Memory:
        """Return the memory after a step: touches, then what the scenario counts."""
        new = dict(t.memory)
        if t.after.bodies.pucks:
            new.update(count_touches(t.memory, t.before, t.after))
        new.update(self.update_memory(t._replace(new_memory=new)))
        return new

    @final
    def all_reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return all reward terms, with the regularizing ones, (..., seats) each.

        goal: 1 while the goal is met, with goals="dict" instead of all others.
        success: with rules="paper" 3 once, by these rules.
        jitter: ``-jitter_weight`` times the squared change of the commanded velocity,
        in top speeds.
        turning: ``-turning_weight`` times the cost of a sudden change of direction.
        regions: what the regions pay in which the seat's paddle is.
        """
        if self.goals == "dict":
            met = self.goal_met(t.after, t.new_memory)
            return {"goal": met[..., None].astype(np.float64)}
        terms = self.reward_terms(t)
        if self.rules == "paper":
            terms["success"] = 3.0 * self.paper_success(t)[..., None]
        if self.jitter_weight:
            cost = _jitter(t.before, t.command, self.scene.seats[0].speed)
            terms["jitter"] = -self.jitter_weight * cost
        if self.turning_weight:
            terms["turning"] = -self.turning_weight * _turning(t.before, t.command)
        if self.reward_regions:
            paid = _sums(t.after.paddle, self.reward_regions)
            terms["regions"] = paid * (t.after.time - t.before.time)[..., None]
        return terms

    @final
    def added_drag(self, state: State) -> Array:
        """(..., pucks) linear drag that regions add, 1/s."""
        return _sums(state.puck, self.drag_regions)

    @final
    def all_marks(self, state: State, memory: Memory) -> list[Mark]:
        """Return what to draw for one world: `marks`, and the regions."""
        paid = self.reward_regions
        means: list[Meaning] = ["reward" if r[3] > 0.0 else "cost" for r in paid]
        means += ["drag"] * len(self.drag_regions)
        regions = zip((*paid, *self.drag_regions), means, strict=True)
        circles = [Mark.circle(np.array(r[:2]), r[2], kind) for r, kind in regions]
        return [*circles, *self.marks(state, memory)]

    @final
    def is_terminated(self, t: Transition) -> Array:
        """(...) bool: `terminated`; with goals="dict", the goal is met.

        With rules="paper" a success and a puck lost at home.

        Without serves, a puck that was lifted off the table ends the episode, too.
        """
        if self.goals == "dict":
            ends = self.goal_met(t.after, t.new_memory)
        elif self.rules == "paper":
            ends = self.paper_success(t) | t.after.crossed.any((-1, -2))
        else:
            ends = self.terminated(t)
        if self.needs_serve(t) is None:
            ends = ends | t.after.lifted.any(-1)
        return ends

    @final
    def is_success(self, t: Transition) -> Array:
        """(...) or (..., seats) bool: `success`; with goals="dict" the goal is met."""
        if self.goals == "dict":
            return self.goal_met(t.after, t.new_memory)
        return self.paper_success(t) if self.rules == "paper" else self.success(t)

    def goal_met(self, state: State, memory: Memory) -> Array:
        """(...) bool: the desired goal is met at a state, by `goal_reward` alone."""
        raise NotImplementedError(f"{type(self).__name__} has no desired goal")

    @final
    def replay_memory(self, memory: Memory, states: State, command: Array) -> Memory:
        """Apply `next_memory` along a recording, as if no time limit were reached.

        Args:
            memory: at the start, (...).
            states: (T + 1, ...) states.
            command: (T, ..., seats, 2) velocities, m/s.

        Returns:
            Memories (T + 1, ...), the first being ``memory``.
        """
        memories = [memory]
        for k in range(len(command)):
            before, after = (states.map(lambda x, i=i: x[i]) for i in (k, k + 1))  # type: ignore[misc]
            old, last = memories[-1], np.zeros(after.time.shape, np.bool_)
            step = Transition(before, command[k], after, old, old, last)
            memories.append(self.next_memory(step))
        return {name: np.stack([m[name] for m in memories]) for name in memory}


def _sums(points: Array, regions: tuple[tuple[float, ...], ...]) -> Array:
    """(..., n) sums of the last numbers of the regions that have points (..., n, 2)."""
    total = np.zeros_like(points[..., 0])
    for x, y, radius, value in regions:
        total = total + value * (length(points - np.array([x, y])) < radius)
    return total


class GoalScenario(Scenario):
    """Scenario with a desired goal, which can be relabelled in hindsight."""

    @property
    @abstractmethod
    def goal_bounds(self) -> tuple[float, ...]:
        """Largest magnitude of each number of a goal."""

    @abstractmethod
    def achieved(self, state: State, memory: Memory) -> Array:
        """(..., goal) achieved goal of a state."""

    @abstractmethod
    def desired(self, memory: Memory) -> Array:
        """(..., goal) desired goal."""

    @abstractmethod
    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        """(...) 1 where the goal is met, else 0; a function of goals alone."""

    def targets(self, memory: Memory) -> Array | None:
        return self.desired(memory)[..., None, :2]

    def shown_reward(self, achieved: Array, desired: Array) -> Array:
        """(...) `goal_reward` of goals from observations, in double precision."""
        goals = (np.asarray(goal, np.float64) for goal in (achieved, desired))
        return self.goal_reward(*goals)

    def goal_met(self, state: State, memory: Memory) -> Array:
        # In the precision of observations, so that `compute_reward` agrees to the bit.
        goals = self.achieved(state, memory), self.desired(memory)
        shown = [goal.astype(np.float32).astype(np.float64) for goal in goals]
        met: Array = self.goal_reward(*shown) > 0
        return met


def _jitter(before: State, command: Array, top_speed: Array | float) -> Array:
    """(..., seats) squared change of the commanded velocity, in top speeds."""
    change = (command - before.paddle_velocity) / top_speed
    x, y = change[..., 0], change[..., 1]
    squared: Array = x * x + y * y
    return squared


def _turning(before: State, command: Array) -> Array:
    """(..., seats) sudden change of direction: 0 straight on, 1 for a reversal."""
    old = before.paddle_velocity
    size = length(old) * length(command)
    along = (old * command).sum(-1)
    return np.where(size > 1e-6, 0.5 * (1 - along / np.maximum(size, 1e-6)), 0.0)
