"""World of the lab: the true simulated table, hidden from all devices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.sim.backends.find import simulated_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.rng import StreamSet
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array

RATE = 120.0
"""Number of steps per second."""
BLOCK = np.array([0.5, 0.25])
"""First position (2,) of the block, table frame, m."""
NEAR = 0.004
"""Height above the table below which the paddle touches pucks, m."""


class LabWorld:
    """World with one puck, a paddle that the arm moves, and a block if there is one.

    Args:
        setup: Setup of the lab.
        seed: Seed of the table's physics parameters, which are sampled from the ranges
            that were measured on real tables.
    """

    def __init__(self, setup: LabSetup, seed: int = 0) -> None:
        blocks = int(setup.block)
        self.scene = Scene(setup.geometry, (setup.seat,), pucks=1, blocks=blocks)
        self._backend = simulated_backend(setup.plant)(self.scene, 1, 1.0 / RATE)
        arms = not self._backend.tracks_commands
        physics = Physics(self.scene.defaults, "ur5e", arms=arms)
        streams = StreamSet(1, "physics")
        rows = np.zeros(1, np.int64)
        streams.renew(rows, np.array([seed]), np.array([1]))
        self.laws = physics.draw(streams.of("physics"))
        """Physics parameters of this table by name, arrays (1,)."""
        self._backend.set_physics(self.laws, rows)
        state = self.scene.still_state(1)
        state.paddle[0, 0] = setup.home
        state.block[0] = BLOCK
        self._paddle = np.array(setup.home)
        self._state = self._begin(state)
        self.held = True
        """True while the operator holds the puck."""
        self.present = False
        """True if the puck is on the table."""
        self.touches: list[float] = []
        """Times of the paddle's contacts since `put`, clock of this world, s."""
        self.banks: list[tuple[float, int]] = []
        """Times, s, and sides of the wall bounces since `put`, clock of this world."""

    def _begin(self, state: State) -> State:
        self._backend.reset(state, np.zeros(1, np.int64))
        return state

    @property
    def time(self) -> float:
        """Time of this world, s."""
        return float(self._state.time[0])

    @property
    def puck(self) -> Array:
        """Position (2,) of the puck, table frame, m."""
        return np.asarray(self._state.puck[0, 0].copy())

    @property
    def puck_velocity(self) -> Array:
        """Velocity (2,) of the puck, table frame, m/s."""
        return np.asarray(self._state.puck_velocity[0, 0].copy())

    @property
    def puck_angle(self) -> float:
        """Orientation of the puck, rad."""
        return float(self._state.angle[0, self.scene.bodies.puck][0])

    @property
    def puck_spin(self) -> float:
        """Angular velocity of the puck, rad/s."""
        return float(self._state.spin[0, self.scene.bodies.puck][0])

    @property
    def block(self) -> tuple[Array, Array] | None:
        """Position, m, and velocity, m/s, (2,) of the block; None without one."""
        if not self.scene.blocks:
            return None
        state = self._state
        return state.block[0, 0].copy(), state.block_velocity[0, 0].copy()

    def put(
        self, place: Array, velocity: Array, held: bool, block: Array | None = None
    ) -> None:
        """Put the puck on the table.

        Args:
            place: Position (2,), table frame, m.
            velocity: Velocity (2,) after the release, table frame, m/s.
            held: True to hold the puck until `release`.
            block: New position (2,) of the block, m; None if it is not moved.

        Raises:
            ValueError: There is no block.
        """
        if block is not None and not self.scene.blocks:
            raise ValueError("this lab has no block: start one with --block")
        position, moving = self._state.position.copy(), self._state.velocity.copy()
        puck = self.scene.bodies.puck
        position[0, puck], moving[0, puck] = place, velocity
        if block is not None:
            position[0, self.scene.bodies.block] = block
            moving[0, self.scene.bodies.block] = 0.0
        spin = np.zeros_like(self._state.spin)
        self._state = self._begin(
            replace(self._state, position=position, velocity=moving, spin=spin)
        )
        self.held, self.present = held, True
        self.touches, self.banks = [], []

    def release(self) -> None:
        """Release the puck."""
        self.held = False

    def remove(self) -> None:
        """Take the puck from the table."""
        self.present = False

    def step(self, paddle: Array, velocity: Array, height: float) -> None:
        """Advance by 1 / `RATE` s.

        Args:
            paddle: Position (2,) of the paddle at the end of the step, m.
            velocity: Velocity (2,) of the paddle, m/s.
            height: Height of the paddle's foot above the table, m.
        """
        command = Command.still(self.scene, 1)
        command.prescribed[0, 0] = *paddle, *velocity
        lies = self.held or not self.present
        command.raised[0, 0] = height > NEAR or lies
        before = self._state
        after = self._backend.step(command)
        if lies:
            puck = self.scene.bodies.puck
            after.position[0, puck] = before.position[0, puck]
            after.velocity[0, puck] = before.velocity[0, puck]
            self._backend.reset(after, np.zeros(1, np.int64))
        else:
            if after.touched[0, 0, 0]:
                self.touches.append(self.time)
            sides = np.flatnonzero(after.banked[0, 0])
            self.banks += [(self.time, int(side)) for side in sides]
        self._state = after
