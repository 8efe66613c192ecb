"""Global state of worlds on a device, for a critic."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from marl_airhockey.device.memory import WorldMemory
from marl_airhockey.sim.world.global_state import GlobalState
from marl_airhockey.sim.world.world import World


class DeviceCriticState:
    """True state of worlds on a device; `GlobalState` defines the elements.

    Args:
        world: A world of the scenario on the CPU.
        memory: Memory of the worlds on the device.
    """

    def __init__(self, world: World, memory: WorldMemory) -> None:
        self._memory, bodies = memory, world.scene.bodies
        self._movers = bodies.movers
        square = world.scene.block_shape == "square"
        self._first = bodies.movers - (bodies.blocks if square else 0)
        self._pucks, device = bodies.puck, memory.rows.device
        radius = torch.tensor(bodies.radius[bodies.puck], dtype=torch.float64)
        self._radius = radius.to(device)
        known = GlobalState(world)
        self._kept = known.memory_names
        self._bound = torch.from_numpy(known.space.high).to(device)
        self._limit = float(memory.facts["max_cycles"])

    def read(self) -> Tensor:
        """Return the states (B, n), float32."""
        memory, movers = self._memory, self._movers
        state = {
            name: self._array(f"state.{name}")
            for name in ("position", "velocity", "spin", "angle")
        }
        motion = torch.cat([state["position"], state["velocity"]], -1)
        share = self._array("episode.cycles").double() / self._limit
        parts = (
            motion[:, :movers],
            self._radius * state["spin"][:, self._pucks],
            state["angle"][:, self._first : movers] % (math.pi / 2),
            *(self._array(f"verdict.memory.{name}") for name in self._kept),
            share.clamp(max=1.0)[:, None],
        )
        worlds = len(memory.rows)
        flat = torch.cat([x.reshape(worlds, -1).double() for x in parts], -1)
        return flat.float().clamp(-self._bound, self._bound)

    def _array(self, name: str) -> Tensor:
        return self._memory.array(f"moment_{self._memory.now}.{name}")
