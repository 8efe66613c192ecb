"""Keep the puck going to and fro, together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Rally(Scenario):
    """A crossing of the middle pays both 1 if the seat that it leaves struck it last.

    That seat must not be the one of the last counted crossing. Only distinct touches
    are strikes: a puck that both squeeze at the middle earns nothing. ``patience``
    seconds without a counted crossing end the rally, and so does a puck that lies.
    """

    seats: str = "arcade"
    seconds: float = 30.0
    crossings: int = 15
    """Counted crossings that make a success."""
    patience: float = 4.0
    """s"""
    jitter_weight: float = 0.0

    @cached_property
    def scene(self) -> Scene:
        seats = self.seat(0, (2,)), self.seat(2, (0,))
        return Scene(self.table_geometry, seats, pucks=1, physics={"tilt": 0.0})

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.first_state(self.scene, worlds)
        state.paddle[..., 0] = 0.7 * self.table_geometry.offsets[0] * np.array([-1, 1])
        toward = np.where(rng.uniform(0.0, 1.0) < 0.5, np.pi, 0.0)
        starts.serve(rng, state, 0, toward)
        names = ("toucher", "counted", "crossings", "idle")
        none = {name: np.zeros(worlds) for name in names}
        touches = rewards.no_touches(worlds, 2, 1)
        return state, {**touches, **none, "strikes": touches["touches"].copy()}

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        old = memory["toucher"]
        fresh = (memory["touches"] > memory["strikes"])[..., 0]
        at = np.where(fresh, after.touched_at[..., 0], -1.0)
        latest = np.where(at[..., 0] > at[..., 1], 1.0, 2.0)
        toucher = np.where(fresh.any(-1), latest, old)
        left = before.puck[..., 0, 0] < 0.0
        crossed = left != (after.puck[..., 0, 0] < 0.0)
        # Numbers count from 1, as `last_toucher` does.
        seat = np.where(left, 1.0, 2.0)
        counts = crossed & ((toucher == seat) | (old == seat))
        counts = counts & (memory["counted"] != seat)
        return {
            "toucher": toucher,
            "counted": np.where(counts, seat, memory["counted"]),
            "crossings": memory["crossings"] + counts,
            "strikes": memory["touches"],
            "idle": np.where(counts, 0.0, memory["idle"] + after.time - before.time),
        }

    observation = (
        observables.OwnPaddle(),
        observables.OtherPaddles(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.IsThisSeat("toucher"),
        observables.IsThisSeat("counted"),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        counted = new["crossings"] - old["crossings"]
        return {"crossing": counted[..., None] * np.ones(2)}

    def terminated(self, after: State, memory: Memory) -> Array:
        slow = rewards.length(after.puck_velocity[..., 0, :]) < rewards.SLOW
        return np.asarray(slow | (memory["idle"] >= self.patience - 1e-9))

    def caption(self, memory: Memory) -> str:
        return f"crossings {memory['crossings']:.0f}"

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["crossings"] >= self.crossings)


make = Rally
