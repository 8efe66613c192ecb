"""Roster: many drivers in one batch of worlds; their seats differ between worlds."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.driven_seat import DrivenSeat
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array


class Roster:
    """Players of a game; each can take any open seat in any of B worlds.

    Args:
        world: Worlds of the game.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.names: list[str] = []
        self._seats: list[list[DrivenSeat]] = []
        self.seated = np.full((world.num_worlds, len(world.scene.seats)), -1)
        """Number of the player at each seat (B, seats); -1 for none."""

    def add(self, name: str, driver: Driver) -> int:
        """Add a player and return its number."""
        world = self.world
        self._seats.append(
            [
                DrivenSeat(
                    seat, driver, world.observer, world.num_worlds, world.control_dt
                )
                for seat in range(len(world.scene.seats))
            ]
        )
        self.names.append(name)
        return len(self.names) - 1

    def begin(self, worlds: Array) -> None:
        """Begin an episode in some worlds, by index (W,), after their reset."""
        seeds, episodes = self.world.seeds, self.world.episode.number
        for player, seat, rows in self._sitting(worlds):
            self._seats[player][seat].reset(rows, seeds, episodes)

    def recall(self, player: int, name: str, values: Array) -> None:
        """Set the memory of a player at all of its seats to values (B, ...)."""
        for seat in self._seats[player]:
            if name in seat.memory:
                seat.memory[name][:] = values

    def ask(self, actions: Array) -> None:
        """Fill the actions of players (B, seats, 2); other seats do not change."""
        known = self.world.known
        for player, seat, rows in self._sitting(np.arange(self.world.num_worlds)):
            actions[rows, seat] = self._seats[player][seat].act(known, rows)

    def _sitting(self, worlds: Array) -> list[tuple[int, int, Array]]:
        """Return (player, seat, worlds) for the seats of players in some worlds."""
        seated, found = self.seated[worlds], []
        for seat in range(seated.shape[1]):
            order = np.argsort(seated[:, seat], kind="stable")
            players, first = np.unique(seated[order, seat], return_index=True)
            for player, rows in zip(
                players.tolist(), np.split(order, first[1:]), strict=True
            ):
                if player >= 0:
                    found.append((player, seat, worlds[rows]))
        return found
