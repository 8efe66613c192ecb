"""Several players on a polygon, each with a goal and lives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    GoalLine,
    Latency,
    Memory,
    Metres,
    Observable,
    RandomStreams,
    Scene,
    Seconds,
    ServingScenario,
    State,
    Table,
    Transition,
    Weight,
    observables,
    products,
    rewards,
    serves,
    sin,
)

START = 0.7
"""Distance of paddles from the centre at the start, divided by the inradius."""


@dataclass(frozen=True, kw_only=True)
class FreeForAll(ServingScenario):
    """Game of several players on a polygon, each with a goal and some lives.

    A goal costs its owner a life. A player without lives is eliminated: its goal
    becomes a wall and its paddle is removed. The last player wins. If the time limit
    ends the game, the player with most lives wins, and among equals the one with most
    shots on goal. After a goal the puck is served to the player who lost a life. A puck
    that is held for ``possession`` seconds, or rests for ``rest`` seconds, is served to
    the next player.

    Start:
        Each paddle is in front of its goal. The puck is served from the centre to one
        of the players, who is sampled.

    Termination:
        One player is left.
    """

    version: ClassVar[int] = 1
    title: ClassVar[str] = "Each for themselves"
    announced = ("lives", "shots", "stopped", "scorer", "served", "serve")
    seats: str = "arcade"
    seconds: Seconds = 90.0
    reaction: Latency = 0.15
    sides: int = 4
    """Number of sides of the table, and of seats."""
    inradius: Metres = 0.45
    """Distance of each side from the centre, m."""
    lives: int = 3
    """Number of conceded goals after which a player is eliminated."""
    goal_width: Metres = 0.30
    """Width of the goal lines, m."""
    possession: Seconds = 1.5
    """Largest time for which a player may have the puck within reach, s."""
    rest: Seconds = 0.5
    """Largest time for which the puck may be slower than 0.05 m/s, s."""
    shot_weight: Weight = 0.0
    """Reward of a stopped shot on goal, and cost for the player who stopped it."""
    jitter_weight: Weight = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sides < 3:
            raise ValueError(f"sides: {self.sides}; expected at least 3")
        between = START * self.table_geometry.offsets[0] * sin(np.pi / self.sides)
        if between < self.table_geometry.paddle_radius:
            raise ValueError(
                f"sides: {self.sides} paddles overlap at the start; choose an inradius "
                f"above {self.inradius:g} m"
            )

    @cached_property
    def table_geometry(self) -> Table:
        return self.furnished(Table.regular(self.sides, self.inradius))

    @cached_property
    def scene(self) -> Scene:
        sides = tuple(range(self.sides))
        seats = tuple(self.seat(side, sides, team=side) for side in sides)
        goal_lines = tuple(
            GoalLine(f"goal_{side}", side, self.goal_width) for side in sides
        )
        flat = {"tilt": 0.0}
        return Scene(
            self.table_geometry, seats, pucks=1, goal_lines=goal_lines, physics=flat
        )

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state, table = self.scene.still_state(worlds), self.table_geometry
        state.paddle[:] = -START * table.offsets[0] * table.normals
        first = np.floor(rng.uniform(0.0, self.sides))
        serves.serve_all(rng, self.scene, state, self._toward(first))
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds = len(rng)
        # The puck moves toward the side that it was served to.
        nearing = products(-state.puck_velocity[:, 0], self.table_geometry.normals)
        return {
            **super().initial_memory(state, rng),
            "lives": np.full((worlds, self.sides), float(self.lives)),
            "shots": np.zeros((worlds, self.sides)),
            "stopped": np.zeros((worlds, self.sides)),
            "held": np.zeros((worlds, self.sides, 1)),
            "lying": np.zeros((worlds, 1)),
            "toucher": np.zeros((worlds, 1)),
            "scorer": np.zeros((worlds, 1)),
            "served": 1.0 * nearing.argmax(-1),
            "serve": np.full(worlds, -1.0),
        }

    def _toward(self, side: Array) -> Array:
        """Return the headings from the centre to sides (W,), table frame, rad."""
        return np.asarray(np.pi + 2.0 * np.pi * side / self.sides)

    def update_memory(self, t: Transition) -> Memory:
        lost = t.after.crossed[..., 0, :] & (t.memory["lives"] > 0.0)
        lives = t.memory["lives"] - lost
        # An eliminated seat holds no puck: a puck at rest in its reach is re-served.
        held = np.where((lives > 0.0)[..., None], rewards.held(self.scene, t), 0.0)
        lying = rewards.resting(t)
        foul = held[..., 0] >= self.possession - 1e-9
        gone = (lying[..., 0] >= self.rest - 1e-9) | t.after.lifted[..., 0]
        dead = gone & ~lost.any(-1)
        serve = np.full_like(t.memory["served"], -1.0)
        for side in range(self.sides):
            follower = self._follower(lives, side)
            heir = np.where(lives[..., side] > 0.0, float(side), follower)
            again = foul[..., side] | (dead & (t.memory["served"] == side))
            serve = np.where(again, follower, serve)
            serve = np.where(lost[..., side], heir, serve)
        fresh = serve >= 0.0
        saves = rewards.saves(self.scene, t, t.memory["toucher"])
        toucher = rewards.last_toucher(t.memory["toucher"], t.after)
        return {
            "lives": lives,
            "shots": t.memory["shots"] + saves.sum(-2),
            "stopped": t.memory["stopped"] + saves.sum(-1),
            "held": np.where(fresh[..., None, None], 0.0, held),
            "lying": np.where(fresh[..., None], 0.0, lying),
            "toucher": np.where(fresh[..., None], 0.0, toucher),
            "scorer": toucher,
            "served": np.where(fresh, serve, t.memory["served"]),
            "serve": serve,
        }

    def _follower(self, lives: Array, side: int) -> Array:
        """Return the next seat with lives after a side (...)."""
        follower = np.full_like(lives[..., 0], float(side))
        for step in range(self.sides - 1, 0, -1):
            other = (side + step) % self.sides
            follower = np.where(lives[..., other] > 0.0, float(other), follower)
        return follower

    @property
    def observation(self) -> tuple[Observable, ...]:
        return (
            observables.OwnPaddle(),
            observables.OtherPaddles(),
            observables.Pucks(),
            observables.OwnToPucks(),
            observables.PossessionTime(self.possession),
            observables.PerSeat("lives", self.lives),
        )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        conceded: -1 for each life that the seat loses.
        scored: 1 for the seat that touched the puck last when another one loses a life.
        shot: ``shot_weight`` for each own shot on goal that another seat stopped, and
        ``-shot_weight`` for each shot that the seat stopped.
        """
        lost = t.memory["lives"] - t.new_memory["lives"]
        own = 1.0 + np.arange(self.sides)
        scored = (t.new_memory["scorer"] == own) & (lost.sum(-1, keepdims=True) > 0.0)
        terms = {"conceded": -lost, "scored": 1.0 * (scored & (lost == 0.0))}
        if self.shot_weight:
            new, old = t.new_memory, t.memory
            shots = new["shots"] - old["shots"] - (new["stopped"] - old["stopped"])
            terms["shot"] = self.shot_weight * shots
        return terms

    def terminated(self, t: Transition) -> Array:
        return np.asarray((1.0 * (t.new_memory["lives"] > 0.0)).sum(-1) <= 1.0)

    def needs_serve(self, t: Transition) -> Array:
        return np.asarray(t.new_memory["serve"] >= 0.0)

    def headings(self, memory: Memory) -> Array:
        return self._toward(memory["serve"])[..., None]

    def eliminated(self, memory: Memory) -> Array | None:
        return np.asarray(memory["lives"] <= 0.0)

    def scores(self, memory: Memory) -> dict[str, Array]:
        """Return the lives and the stopped shots on goal, by seat."""
        return {"lives": memory["lives"], "shots": memory["shots"]}

    def deciders(self, memory: Memory) -> dict[str, Array]:
        """Return the lives, and the shots on goal for equal lives."""
        lives, shots = memory["lives"], memory["shots"]
        leading = lives == lives.max(-1, keepdims=True)
        merit = np.where(leading, shots, -1.0)
        best = merit == merit.max(-1, keepdims=True)
        return {"lives": leading.sum(-1) == 1, "shots on goal": best.sum(-1) == 1}

    def success(self, t: Transition) -> Array:
        """(..., seats) bool: The seat is the last one, or leads at the time limit."""
        lives, shots = t.new_memory["lives"], t.new_memory["shots"]
        merit = np.where(lives == lives.max(-1, keepdims=True), shots, -1.0)
        best = merit == merit.max(-1, keepdims=True)
        alone = best.sum(-1, keepdims=True) == 1
        return np.asarray(
            best & alone & (self.terminated(t) | t.time_limit_reached)[..., None]
        )


make = FreeForAll
