"""Scenario contract: scene, initial states, goals, rewards and ends of episodes.

The functions of a scenario are pure and vectorised. The same code works for one world,
4096 worlds and a stored dataset. The leading axes belong to the caller.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, final

import numpy as np

from marl_airhockey.sim.contracts.display import Display
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
    """One control step, as scenario functions receive it; leading axes (...)."""

    before: State
    command: Array
    """Commanded velocities after the limits (..., seats, 2), table frame, m/s."""
    after: State
    memory: Memory
    """Memory before the step."""
    new_memory: Memory
    """Memory after the step."""
    time_limit_reached: Array
    """True if the time limit ends the episode with this step (...)."""


@dataclass(frozen=True, kw_only=True)
class Scenario(Display, ABC):
    """Scenario, whose fields are its options.

    The memory contains arrays (..., *) by name. For every scenario with pucks it
    contains `touches` and `apart`, see `touches.count_touches`.
    """

    seats: str = "robot"
    """Kind of the seats: "robot" (limits of a UR5e) or "arcade"."""
    table: str = "standard"
    """Table preset."""
    goals: str = "flat"
    """"dict" returns desired and achieved goals separately, as HER needs them."""
    rules: str = "own"
    """"paper" evaluates success by the paper's published code: `paper_success`."""
    obstacles: tuple[tuple[float, ...], ...] = ()
    """Obstacles on the table: discs x, y, radius, or bars x, y, radius, x2, y2 between
    two points (m)."""
    reward_regions: tuple[tuple[float, ...], ...] = ()
    """Discs x, y, radius (m) and the reward per second for a seat whose paddle's centre
    is inside. It is below 0 for regions to avoid."""
    drag_regions: tuple[tuple[float, ...], ...] = ()
    """Discs x, y, radius (m) and the linear drag (1/s) that is added for a puck whose
    centre is inside at the start of a control step."""
    jitter_weight: Weight = 0.01
    """Cost of a squared change of the commanded velocity, in top speeds."""
    turning_weight: Weight = 0.0
    """Cost of a sudden change of direction."""
    reaction: Latency = 0.0
    """Latency of pucks and other paddles (s), a multiple of the control step, in
    addition to the latency of the profile's sensing."""

    seconds: Seconds
    """Length of an episode, s."""

    announced: ClassVar[tuple[str, ...]] = ()
    """Names of the arrays of the memory that are exact for all seats, such as a score.
    With simulated sensing, the other arrays are computed from the sensed states."""
    version: ClassVar[int] = 0
    """Version in the gymnasium id, raised whenever numbers of the scenario change."""
    title: ClassVar[str] = ""
    """Title for people who play it; by default its name."""

    def __post_init__(self) -> None:
        for name, value in checked_options(self).items():
            object.__setattr__(self, name, value)
        check_places(self, self.scene.table)
        if self.obstacles and not self.scene.obstacles:
            raise ValueError("obstacles: not possible on this scenario's own table")
        if self.goals == "dict" and not isinstance(self, GoalScenario):
            raise ValueError('goals="dict": this scenario has no desired goal')
        if self.rules == "paper":
            if type(self).paper_success is Scenario.paper_success:
                raise ValueError('rules="paper": not one of the ten tasks of the paper')
            if self.goals == "dict":
                raise ValueError('rules="paper": with goals="dict" the goal decides')
        if self.goals == "dict" and self.reaction:
            raise ValueError('reaction: must be 0 with goals="dict"')

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Seats, bodies and goal lines."""

    @abstractmethod
    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        """Sample the initial states and memories of ``worlds`` worlds, one row each."""

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        """Return the memory of an episode that begins in given states, one row each.

        The states come from `reset`, `set_state`, a recording or a real table.
        Scenarios add their own arrays to the result.
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

        It is called after `reset` and `initial_memory`. Most scenarios do not override
        it. ``physics`` contains the parameters of the episode (W,) by name.
        """
        return memory

    def update_memory(self, t: Transition) -> Memory:
        """Return the arrays of the memory that a step changes.

        ``t.memory`` is the memory before the step. ``t.new_memory`` is the same with
        the new touches. An event that happens once needs its own flag, ``old | now``.
        """
        return {}

    @property
    @abstractmethod
    def observation(self) -> tuple[Observable, ...]:
        """Observables of a seat, concatenated in this order."""

    @abstractmethod
    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the terms (..., seats) by name. The reward is their sum."""

    def terminated(self, t: Transition) -> Array:
        """(...) bool: the episode ended by the rules of the game."""
        return np.zeros(t.after.time.shape, np.bool_)

    def needs_serve(self, t: Transition) -> Array | None:
        """(...) bool: a puck must be served after the step; None if never."""
        return None

    def serve(
        self, rng: RandomStreams, state: State, memory: Memory
    ) -> tuple[State, Memory]:
        """Serve a puck in the worlds that need it, one row each.

        The rows are copies, which may be changed and returned.
        """
        raise NotImplementedError(f"{type(self).__name__} serves no puck")

    @abstractmethod
    def success(self, t: Transition) -> Array:
        """(...) or (..., seats) bool: success in this step; the episode latches it."""

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: success in this step by the paper's published code.

        The code is github.com/CalCharles/air-hockey-rl, commits aee389d and 747580d.
        Its x has the opposite sign. With rules="paper" this function replaces
        `success`, also in the rewards, and a success ends the episode.
        """
        raise NotImplementedError(f"{type(self).__name__} is not a task of the paper")

    def targets(self, memory: Memory) -> Array | None:
        """Return points (W, n, 2), m, that obstacles must leave free; None for none."""
        return None

    @property
    def moving_start(self) -> bool:
        """True if bodies moved at constant velocity before the start of an episode.

        Observations with a reaction time then show this movement at first. Otherwise
        they show the start.
        """
        return False

    @property
    def hides(self) -> bool:
        """True if `hidden` hides pucks at some time."""
        return False

    def hidden(self, state: State, memory: Memory) -> Array:
        """(..., pucks) bool: no seat sees the puck now, by the rules of the scenario.

        Its last visible position and velocity are observed instead.
        """
        return np.zeros(state.visible.shape, np.bool_)

    @final
    @property
    def name(self) -> str:
        """Name of the file that defines the scenario."""
        return type(self).__module__.rpartition(".")[2]

    @cached_property
    def table_geometry(self) -> Table:
        """Table of the option ``table``, with the obstacles."""
        return self.furnished(TABLES[self.table])

    @final
    def furnished(self, table: Table) -> Table:
        """Return a table with the obstacles of the scenario."""
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
        """Return the memory after a step: touches, then the scenario's own arrays."""
        new = dict(t.memory)
        if t.after.bodies.pucks:
            new.update(count_touches(t.memory, t.before, t.after))
        new.update(self.update_memory(t._replace(new_memory=new)))
        return new

    @final
    def all_reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return all reward terms (..., seats), including the regularizing terms.

        goal: 1 while the goal is met, with goals="dict" instead of all other terms.
        success: with rules="paper" 3 once, by these rules.
        jitter: ``-jitter_weight`` times the squared change of the commanded velocity,
        in top speeds.
        turning: ``-turning_weight`` times the cost of a sudden change of direction.
        regions: reward of the regions in which the seat's paddle is.
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
        """Return the linear drag (..., pucks) that regions add, 1/s."""
        return _sums(state.puck, self.drag_regions)

    @final
    def is_terminated(self, t: Transition) -> Array:
        """(...) bool: the episode ended by `terminated`.

        With goals="dict" it ends when the goal is met. With rules="paper" it ends with
        a success or when a puck crosses a goal line. In a scenario without serves, a
        puck that was lifted off the table ends it, too.
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
        """(...) or (..., seats) bool: success in this step.

        It is `goal_met` with goals="dict", `paper_success` with rules="paper", and
        `success` otherwise.
        """
        if self.goals == "dict":
            return self.goal_met(t.after, t.new_memory)
        return self.paper_success(t) if self.rules == "paper" else self.success(t)

    def goal_met(self, state: State, memory: Memory) -> Array:
        """(...) bool: the desired goal is met in a state, by `goal_reward` alone."""
        raise NotImplementedError(f"{type(self).__name__} has no desired goal")

    @final
    def replay_memory(self, memory: Memory, states: State, command: Array) -> Memory:
        """Apply `next_memory` along a recording, as if no time limit were reached.

        Args:
            memory: Memory (...) at the start.
            states: States (T + 1, ...), table frame.
            command: Commanded velocities (T, ..., seats, 2), table frame, m/s.

        Returns:
            Memories (T + 1, ...). The first one is ``memory``.
        """
        memories = [memory]
        for k in range(len(command)):
            before, after = (states.map(lambda x, i=i: x[i]) for i in (k, k + 1))  # type: ignore[misc]
            old, last = memories[-1], np.zeros(after.time.shape, np.bool_)
            step = Transition(before, command[k], after, old, old, last)
            memories.append(self.next_memory(step))
        return {name: np.stack([m[name] for m in memories]) for name in memory}


def _sums(points: Array, regions: tuple[tuple[float, ...], ...]) -> Array:
    """Return the sums (..., n) of the values of the regions that contain points.

    Args:
        points: Points (..., n, 2), table frame, m.
        regions: Regions x, y, radius, m, and value.
    """
    total = np.zeros_like(points[..., 0])
    for x, y, radius, value in regions:
        total = total + value * (length(points - np.array([x, y])) < radius)
    return total


class GoalScenario(Scenario):
    """Base of scenarios with a desired goal, which hindsight can relabel."""

    @property
    @abstractmethod
    def goal_bounds(self) -> tuple[float, ...]:
        """Largest magnitude of each number of a goal."""

    @abstractmethod
    def achieved(self, state: State, memory: Memory) -> Array:
        """Return the achieved goal (..., goal) of a state."""

    @abstractmethod
    def desired(self, memory: Memory) -> Array:
        """Return the desired goal (..., goal)."""

    @abstractmethod
    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        """Return 1 where the goal is met, else 0 (...). It depends on goals alone."""

    def targets(self, memory: Memory) -> Array | None:
        return self.desired(memory)[..., None, :2]

    def shown_reward(self, achieved: Array, desired: Array) -> Array:
        """Return `goal_reward` (...) of observed goals, in double precision."""
        goals = (np.asarray(goal, np.float64) for goal in (achieved, desired))
        return self.goal_reward(*goals)

    def goal_met(self, state: State, memory: Memory) -> Array:
        # Goals have the precision of observations, so that `compute_reward` returns the
        # same values.
        goals = self.achieved(state, memory), self.desired(memory)
        shown = [goal.astype(np.float32).astype(np.float64) for goal in goals]
        met: Array = self.goal_reward(*shown) > 0
        return met


def _jitter(before: State, command: Array, top_speed: Array | float) -> Array:
    """Return the squared change (..., seats) of the command, in top speeds."""
    change = (command - before.paddle_velocity) / top_speed
    x, y = change[..., 0], change[..., 1]
    squared: Array = x * x + y * y
    return squared


def _turning(before: State, command: Array) -> Array:
    """Return the change of direction (..., seats): 0 for none, 1 for a reversal."""
    old = before.paddle_velocity
    size = length(old) * length(command)
    along = (old * command).sum(-1)
    return np.where(size > 1e-6, 0.5 * (1 - along / np.maximum(size, 1e-6)), 0.0)
