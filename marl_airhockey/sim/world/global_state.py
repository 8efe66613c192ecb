"""Global state: the true state of a world as a flat array, for a critic."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from gymnasium import spaces

from marl_airhockey.sim.core.parameters import PUCK_SPEED_CAP
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.types import Array, Memory

if TYPE_CHECKING:
    from marl_airhockey.sim.world.world import World

MOST = 10.0
"""Bound of the elements of the memory, which also represents "never" (inf)."""


class GlobalState:
    """True state of a world, table frame.

    The state, the actions and the physics of the episode determine the next state. The
    elements are, in this order:

    - x, y, vx, vy of all bodies that move, m and m/s,
    - spin of pucks, as the speed of their edges, m/s,
    - rotation of square blocks, modulo a quarter turn, rad,
    - memory of the scenario, such as lives, goals and the last toucher, clipped to
      -10 .. 10,
    - share of the time limit that has passed.

    Args:
        world: Worlds, before or after their first reset.
    """

    def __init__(self, world: World) -> None:
        self._world, scene = world, world.scene
        first = np.zeros(1, np.int64)
        rng = RandomStreams.keyed(first, first, "start")
        self._memory: Memory = world.scenario.reset(rng, 1)[1]
        self.memory_names = tuple(self._memory)
        """Names of the arrays of the memory, in the order of their elements."""
        self._rotating = scene.bodies.blocks if scene.block_shape == "square" else 0
        self._bound = self._bounds()
        self.labels = tuple(self._names())
        """Name of each element."""
        low, high = -self._bound, self._bound.copy()
        low[-1] = 0.0
        self.space = spaces.Box(low, high, dtype=np.float32)

    def _bounds(self) -> Array:
        """Return bounds of all elements; a puck out of play is behind a goal."""
        scene, pucks = self._world.scene, self._world.scene.bodies.pucks
        motion = np.full((scene.bodies.movers, 4), PUCK_SPEED_CAP)
        motion[:, :2] = np.abs(np.asarray(scene.table.vertices)).max(0) + 0.25
        fastest = self._world.physics.highest("paddle_speed")
        motion[scene.bodies.paddle, 2:] = fastest
        spins = np.full(pucks, PUCK_SPEED_CAP)
        angles = np.full(self._rotating, np.pi / 2)
        kept = np.full(sum(array[0].size for array in self._memory.values()), MOST)
        parts = motion.ravel(), spins, angles, kept, [1.0]
        return np.concatenate(parts).astype(np.float32)

    def _names(self) -> Iterator[str]:
        bodies = self._world.scene.bodies
        kinds = {"paddle": bodies.paddles, "puck": bodies.pucks, "block": bodies.blocks}
        for kind, count in kinds.items():
            for i in range(count):
                yield from (f"{kind}_{i}.{x}" for x in ("x", "y", "vx", "vy"))
        yield from (f"puck_{i}.spin" for i in range(bodies.pucks))
        yield from (f"block_{i}.turn" for i in range(self._rotating))
        for name, array in self._memory.items():
            for place in np.ndindex(array.shape[1:]):
                yield "_".join(map(str, (name, *place)))
        yield "time_share"

    def read(self) -> Array:
        """Return the states (B, n), float32, in a new array."""
        world, bodies = self._world, self._world.scene.bodies
        state, memory = world.get_state()
        b, first = world.num_worlds, bodies.movers - self._rotating
        motion = np.concatenate([state.position, state.velocity], -1)
        kept = [memory[name].reshape(b, -1) for name in self.memory_names]
        parts = (
            motion[:, : bodies.movers].reshape(b, -1),
            state.puck_edge,
            state.angle[:, first : bodies.movers] % (np.pi / 2),
            *kept,
            np.minimum(world.episode.cycles / world.limits, 1.0)[:, None],
        )
        flat = np.concatenate(parts, -1).astype(np.float32)
        return np.clip(flat, -self._bound, self._bound)
