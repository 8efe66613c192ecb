"""Many drivers at the seats of one batch of worlds: who sits where differs by world."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.driven_seat import DrivenSeat
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array


class Roster:
    """Players of a game, each able to take any seat in any of B worlds.

    Args:
        world: the worlds; the seats that players take are open ones.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.names: list[str] = []
        self._seats: list[list[DrivenSeat]] = []
        self.seated = np.full((world.num_worlds, len(world.scene.seats)), -1)
        """(B, seats) which player sits where, by number; -1 for none of them."""

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

    def replace(self, player: int, name: str, driver: Driver) -> None:
        """Give a player's number to another; take it off all seats first."""
        self.add(name, driver)
        self._seats[player], self.names[player] = self._seats.pop(), self.names.pop()

    def begin(self, worlds: Array) -> None:
        """Begin an episode in some worlds, by index: after they restarted."""
        seeds, episodes = self.world.seeds, self.world.episode.number
        for player, seat, rows in self._sitting(worlds):
            self._seats[player][seat].reset(rows, seeds, episodes)

    def ask(self, actions: Array) -> None:
        """Fill in (B, seats, 2) what players ask for; other seats are left alone."""
        known = self.world.known
        for player, seat, rows in self._sitting(np.arange(self.world.num_worlds)):
            actions[rows, seat] = self._seats[player][seat].act(known, rows)

    def _sitting(self, worlds: Array) -> list[tuple[int, int, Array]]:
        """Player, seat and the worlds, among some, where the one sits at the other."""
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
