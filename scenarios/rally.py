"""Two players keep a puck going to and fro."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    Memory,
    Metres,
    RandomStreams,
    Scenario,
    Scene,
    Seconds,
    State,
    Transition,
    Weight,
    length,
    observables,
    rewards,
    serves,
)


@dataclass(frozen=True, kw_only=True)
class Rally(Scenario):
    """Game in which two players keep a puck going to and fro.

    A crossing of the centre line counts if the puck was more than ``depth`` behind it
    and the player on that side touched it last. Counted crossings must alternate in
    direction. Only distinct touches count: a puck that both paddles squeeze at the
    centre line gives no reward.

    Start:
        The paddles are near their ends. The puck is served from the centre to one of
        the players, who is sampled.

    Termination:
        ``patience`` seconds without a counted crossing, or a puck at rest.
    """

    title: ClassVar[str] = "Rally"
    announced = ("counted", "crossings", "idle")
    seats: str = "arcade"
    seconds: Seconds = 30.0
    crossings: int = 15
    """Number of counted crossings for a success."""
    depth: Metres = 0.3
    """Distance from the centre line that the puck must have exceeded, m."""
    patience: Seconds = 4.0
    """Longest time without a counted crossing, s."""
    jitter_weight: Weight = 0.0

    @cached_property
    def scene(self) -> Scene:
        seats = self.seat(0, (2,)), self.seat(2, (0,))
        return Scene(self.table_geometry, seats, pucks=1, physics={"tilt": 0.0})

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = self.scene.still_state(worlds)
        state.paddle[..., 0] = 0.7 * self.table_geometry.offsets[0] * np.array([-1, 1])
        toward = np.where(rng.uniform(0.0, 1.0) < 0.5, np.pi, 0.0)
        serves.serve_all(rng, self.scene, state, toward)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        names = ("toucher", "counted", "crossings", "idle")
        none = {name: np.zeros(len(rng)) for name in names}
        touches = super().initial_memory(state, rng)
        none["deep"] = np.zeros((len(rng), 1))
        return {**touches, **none, "strikes": touches["touches"].copy()}

    def update_memory(self, t: Transition) -> Memory:
        old = t.memory["toucher"]
        fresh = (t.new_memory["touches"] > t.memory["strikes"])[..., 0]
        at = np.where(fresh, t.after.touched_at[..., 0], -1.0)
        latest = np.where(at[..., 0] > at[..., 1], 1.0, 2.0)
        toucher = np.where(fresh.any(-1), latest, old)
        x = t.after.puck[..., 0, 0]
        left = t.before.puck[..., 0, 0] < 0.0
        crossed = left != (x < 0.0)
        # Seats are numbered from 1, as in `last_toucher`.
        seat = np.where(left, 1.0, 2.0)
        counts = crossed & ((toucher == seat) | (old == seat))
        # Depth of the contact in the half that the puck leaves or will leave.
        struck = rewards.contact_height(t)[..., 0]
        into = np.where(np.isnan(struck), 0.0, np.where(left, -struck, struck))
        deep = (t.memory["deep"][..., 0] > 0.0) | (into > self.depth)
        counts = counts & deep & (t.memory["counted"] != seat)
        deep = (deep & ~crossed) | (np.maximum(np.abs(x), -into) > self.depth)
        return {
            "toucher": toucher,
            "counted": np.where(counts, seat, t.memory["counted"]),
            "crossings": t.memory["crossings"] + counts,
            "deep": 1.0 * deep[..., None],
            "strikes": t.new_memory["touches"],
            "idle": np.where(
                counts, 0.0, t.memory["idle"] + t.after.time - t.before.time
            ),
        }

    observation = (
        observables.OwnPaddle(),
        observables.OtherPaddles(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.IsThisSeat("toucher"),
        observables.IsThisSeat("counted"),
        observables.FromMemory("deep", 0.0, 1.0, 1.0),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        crossing: 1 for both players for each counted crossing of the centre line.
        """
        counted = t.new_memory["crossings"] - t.memory["crossings"]
        return {"crossing": counted[..., None] * np.ones(2)}

    def terminated(self, t: Transition) -> Array:
        slow = length(t.after.puck_velocity[..., 0, :]) < rewards.SLOW
        return np.asarray(slow | (t.new_memory["idle"] >= self.patience - 1e-9))

    def scores(self, memory: Memory) -> dict[str, Array]:
        return {"crossings": memory["crossings"][..., None]}

    def success(self, t: Transition) -> Array:
        """(...) bool: There have been ``crossings`` counted crossings."""
        return np.asarray(t.new_memory["crossings"] >= self.crossings)

    def caption(self, memory: Memory) -> Caption:
        numbers = memory["crossings"], self.crossings
        return Caption("crossings {:.0f} of {:.0f}", *numbers)


make = Rally
