"""One against one: get the puck into the other's goal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey import rewards, starts, views
from marl_airhockey.cast import Cast, Mouth
from marl_airhockey.draws import Draws
from marl_airhockey.scenario import Scenario
from marl_airhockey.state import Array, Memory, State


@dataclass(frozen=True, kw_only=True)
class Duel(Scenario):
    """A goal pays 1 and costs the other 1; the first with ``goals_to_win`` has won.

    After a goal the puck is served from the centre toward whoever conceded it. Holding
    the puck within reach for ``possession`` seconds is a foul: a serve to the other
    side. A puck that lies out of everybody's reach is served again.
    """

    seats: str = "arcade"
    seconds: float = 60.0
    goals_to_win: int = 7
    """Goals."""
    mouth: float = 0.30
    """m: width of the goal mouths."""
    possession: float = 5.0
    """s: for so long a seat may have the puck in its reach."""
    jitter_weight: float = 0.0

    @cached_property
    def cast(self) -> Cast:
        seats = (self.seat(0, (2,), team=0), self.seat(2, (0,), team=1))
        mouths = (Mouth("home", 0, self.mouth), Mouth("far", 2, self.mouth))
        flat = {"tilt": 0.0}
        return Cast(self.table_geometry, seats, pucks=1, mouths=mouths, physics=flat)

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        state = starts.first_state(self.cast, worlds)
        side = self.table_geometry.offsets[0]
        state.position[:, 0, 0], state.position[:, 1, 0] = -0.7 * side, 0.7 * side
        toward = np.where(draws.uniform(0.0, 1.0) < 0.5, -1.0, 1.0)
        starts.serve(draws, state, 2, toward)
        return state, {
            **rewards.no_touches(worlds, 2, 1),
            "goals": np.zeros((worlds, 2)),
            "held": np.zeros((worlds, 2)),
            "lying": np.zeros(worlds),
            "serve": np.zeros(worlds),
        }

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        dt = (after.time - before.time)[..., None]
        home, far = after.crossed[..., 0, 0], after.crossed[..., 0, 1]
        scored = after.crossed[..., 0, ::-1]
        has = rewards.in_reach(self.cast, after.puck[..., 0, :])
        held = np.where(has, memory["held"] + dt, 0.0)
        foul = held >= self.possession - 1e-9
        slow = rewards.length(after.puck_velocity[..., 0, :]) < 0.05
        lies = slow & ~has.any(-1) & ~(home | far)
        lying = np.where(lies, memory["lying"] + dt[..., 0], 0.0)
        serve = 1.0 * (far | foul[..., 0]) - 1.0 * (home | foul[..., 1])
        again = (serve == 0.0) & (lying >= 1.0 - 1e-9)
        nearer = np.where(after.puck[..., 0, 0] < 0.0, -1.0, 1.0)
        return {
            "goals": memory["goals"] + scored,
            "held": np.where((serve != 0.0)[..., None], 0.0, held),
            "lying": np.where(again, 0.0, lying),
            "serve": np.where(again, nearer, serve),
        }

    observation = (
        views.Own(),
        views.Others(),
        views.Pucks(),
        views.PucksFromOwn(),
        views.OwnTally("held", 0.0, 5.0, 2.0),
    )

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        scored = new["goals"] - old["goals"]
        return {"goal": scored - scored[..., ::-1]}

    def terminated(self, after: State, memory: Memory) -> Array:
        return np.asarray((memory["goals"] >= self.goals_to_win).any(-1))

    def restart(
        self, draws: Draws, after: State, memory: Memory
    ) -> tuple[Array, State, Memory] | None:
        worlds = np.flatnonzero(memory["serve"])
        if not len(worlds):
            return None
        rows = after.map(lambda x: x[worlds])
        starts.serve(draws.select(worlds), rows, 2, memory["serve"][worlds])
        kept = {name: value[worlds] for name, value in memory.items()}
        return worlds, rows, {**kept, "serve": np.zeros(len(worlds))}

    def success(self, after: State, memory: Memory) -> Array:
        goals = memory["goals"]
        over = (after.time >= self.seconds - 1e-9)[..., None]
        return (goals >= self.goals_to_win) | (over & (goals > goals[..., ::-1]))


make = Duel
