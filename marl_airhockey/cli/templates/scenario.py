"""Strike the puck so that it bounces off three walls, and touch it again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Memory,
    RandomStreams,
    Scenario,
    Scene,
    State,
    Transition,
    observables,
    rewards,
    starts,
)

# Arrays have leading axes `...`: none for one world, one for a batch of worlds, or the
# steps of a recording. Write `[..., 0]` instead of `[:, 0]`, and `np.where` instead of
# `if`, so that the rules can be compiled. Positions are in metres, in the table frame:
# the origin is the centre of the table, x points to the far end, y to the left.


@dataclass(frozen=True, kw_only=True)
class Template(Scenario):
    """Task of striking the puck so that it bounces off several walls.

    The puck must bounce off ``banks`` walls between two touches. A touch before the
    last wall bounce resets the count. Describe here what the task rewards, and why
    there is no easier way to obtain the reward.

    Start:
        The paddle is near the home end, and the puck rests in front of it.

    Termination:
        Success.
    """

    # The fields are the options of the task, `--option banks=2`. The docstring of each
    # field is its description in `airhockey list`.
    seconds: float = 8.0
    """Length of an episode, s."""
    banks: int = 3
    """Number of wall bounces between two touches."""

    @cached_property
    def scene(self) -> Scene:
        # The bodies on the table: one seat with the limits of a UR5e, and a puck. Add
        # a goal as a `GoalLine`. `physics` overrides physics parameters of the table.
        return Scene(
            self.table_geometry, (self.seat(),), pucks=1, physics={"tilt": 0.0}
        )

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        # Return the first state and memory of each world. Take all random numbers from
        # `rng`. Bodies are sorted by kind: paddles, then pucks.
        state = self.scene.still_state(worlds)
        box = partial(starts.uniform_box, rng, self.scene.table)
        state.paddle[:, 0] = box((-0.74, -0.64), starts.PADDLE_Y)
        state.puck[:, 0] = box((-0.49, -0.32), (-0.20, 0.20))
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        # Quantities that the rules store during an episode. The base class stores
        # touches. `FromMemory`, below, observes entries with one number per puck.
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "gap": starts.puck_gap(state),
            "banks": np.zeros((worlds, 1)),
            "done": np.zeros(worlds, np.bool_),
        }

    def update_memory(self, t: Transition) -> Memory:
        # Return the entries that change in a step. Inputs: the states `t.before` and
        # `t.after`, `t.memory`, and `t.new_memory` with the new touches.
        struck = rewards.touched(t.memory)
        touch = (t.new_memory["touches"] > t.memory["touches"]).any(-2)
        banks = t.memory["banks"] + struck[..., None] * t.after.banked.sum(-1)
        return {
            "gap": rewards.nearest(t),
            "banks": np.where(touch, 0.0, banks),
            "done": t.memory["done"] | (touch & (banks >= self.banks)).any(-1),
        }

    # Observation of a seat. Bounds, names and scaling are derived from it.
    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.FromMemory("banks", 0.0, 10.0, 3.0),
    )

    # Reward terms by name, each (..., seats). Their sum is the reward. `airhockey list`
    # prints the description of each term in the docstring.
    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        bank: 0.2 for each wall bounce that counts.
        success: 3, once.
        """
        counted = np.minimum(t.new_memory["banks"], self.banks)
        fresh = counted - np.minimum(t.memory["banks"], self.banks)
        return {
            "approach": (t.memory["gap"] - t.new_memory["gap"])[..., None],
            "bank": 0.2 * np.maximum(fresh, 0.0),
            "success": 3.0 * (t.new_memory["done"] & ~t.memory["done"])[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return t.new_memory["done"]

    def success(self, t: Transition) -> Array:
        """(...) bool: The puck was touched again after enough wall bounces."""
        # Chance must not satisfy this rule: check it with `airhockey evaluate still`
        # and `airhockey evaluate random`.
        return t.new_memory["done"]


make = Template
