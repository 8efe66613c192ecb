"""Drivers of a match: people with input devices, policies and scripts."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np

from marl_airhockey.build import refuse_erratic
from marl_airhockey.play.handicap import SEEN, Handicap, HandicappedDriver
from marl_airhockey.play.ladder import Level, ladder_of
from marl_airhockey.policies.load import ZOO, policy_file
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.registry import (
    make_driver,
    make_scenario,
    zoo_names,
)
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.driven_seat import DrivenSeat
from marl_airhockey.sim.world.world import World
from marl_airhockey.toolkit.pointing import ARM_LAG
from marl_airhockey.types import Array

PERSON = "person"
"""Name of the driver of a seat for people."""


class MatchDrivers:
    """Drivers of all seats of a world; initially a person in each seat.

    Args:
        world: Batch with a single world.
        profile: Profile of the world, by which fitting policies are sorted.
    """

    def __init__(self, world: World, profile: str) -> None:
        self._world, self._profile = world, profile
        seats = world.scene.seats
        self.handicaps = [Handicap() for _ in seats]
        """Handicap of the driver of each seat; none for people."""
        self.names = [PERSON for _ in seats]
        """Name or path of the driver of each seat."""
        self._device_kinds = ["mouse" for _ in seats]
        lag = ARM_LAG if world.live is not None else 0.0
        self._by_kind = {"mouse": f"mouse:lag={lag}", "gamepad": "gamepad"}
        self._devices = [make_driver(self._by_kind["mouse"]) for _ in seats]
        self._driven = [self._build(i) for i in range(len(seats))]

    @cached_property
    def ladder(self) -> list[Level]:
        """Levels of opponents that players can choose.

        On a real table, no driver observes with additional latency or errors.
        """
        teams = {seat.team for seat in self._world.scene.seats}
        name = self._world.scenario.name
        levels = ladder_of(name, self.fitting_policies, len(teams) > 1)
        real = self._world.live is not None
        return [level for level in levels if not (real and level.handicap.observes)]

    def level(self, i: int) -> str:
        """Return the name of the level of a seat; "" for a driver of no level."""
        now = self.names[i], self.handicaps[i]
        names = [x.name for x in self.ladder if (x.driver, x.handicap) == now]
        return next(iter(names), "")

    @property
    def digests(self) -> list[str]:
        """First 16 hexadecimal digits of the SHA-256 of each seat's policy, or ""."""
        files = [policy_file(name.partition(":")[0]) for name in self.names]
        return [
            hashlib.sha256(file.read_bytes()).hexdigest()[:16] if file.is_file() else ""
            for file in files
        ]

    @cached_property
    def best_policy(self) -> dict[str, Any] | None:
        """Facts about the best fitting policy of the zoo; None without one.

        ``success`` is its success rate in a task, or None. ``minutes`` is the CPU time
        of its training.
        """
        if not self.fitting_policies:
            return None
        card = NumpyPolicy.load(policy_file(self.fitting_policies[0])).card
        success = card.get("grades", {}).get("success")
        return {"success": success, "minutes": card.get("cpu_minutes")}

    @cached_property
    def fitting_policies(self) -> list[str]:
        """Policies of the zoo with the same rules, table, seats and observations.

        Policies that were trained in the same profile come first.
        """
        scenario, observer = self._world.scenario, self._world.observer
        found: list[tuple[bool, str]] = []
        for name in zoo_names():
            card = NumpyPolicy.load(ZOO / f"{name[4:]}.npz").card
            # Compare the scenario first, because a layout has to be compiled.
            if card["scenario"] != scenario.name:
                continue
            own = make_scenario(card["scenario"], **card["options"])
            same = own.seats == scenario.seats and own.table == scenario.table
            if same and card["labels"] == list(
                observer.layout_of(card["observe"]).labels
            ):
                found.append((card["profile"] != self._profile, name))
        return [name for _, name in sorted(found)]

    def enter(self, world: World) -> None:
        """Move the drivers to another world of the same game."""
        self._world = world
        for seat in self._driven:
            seat.driver.__exit__(None, None, None)
        self._driven = [self._build(i) for i in range(len(self.names))]

    def set(self, i: int, name: str, handicap: Handicap) -> None:
        """Set the driver of a seat; the old driver remains if the new one does not fit.

        A person and a driver that owns a device have no handicap.

        Raises:
            ValueError: The name is unknown, or the policy does not fit.
        """
        old_name, old_handicap, old = self.names[i], self.handicaps[i], self._driven[i]
        self.names[i], self.handicaps[i] = name, handicap
        try:
            self._driven[i] = self._build(i)
            self.reset([i])
            self.action(i)  # A policy that does not fit fails here, not in a match.
        except ValueError:
            self.names[i], self.handicaps[i] = old_name, old_handicap
            self._driven[i] = old
            raise
        old.driver.__exit__(None, None, None)

    def input_device(self, i: int, kind: str) -> Driver:
        """Return the driver of a person's input device: "mouse" or "gamepad"."""
        if self.names[i] == PERSON and self._device_kinds[i] != kind:
            self._device_kinds[i] = kind
            self._devices[i] = make_driver(self._by_kind[kind])
            self._driven[i] = self._build(i)
            self.reset([i])
        return self._devices[i]

    def kind_of_device(self, i: int) -> str:
        """Return the input device of a seat: "mouse" or "gamepad"."""
        return self._device_kinds[i]

    def reset(self, seats: Iterable[int]) -> None:
        """Start an episode for the drivers of some seats."""
        one, world = np.zeros(1, np.int64), self._world
        for i in seats:
            self._driven[i].reset(one, world.seeds, world.episode.number)

    def action(self, i: int) -> Array:
        """Return the action of a seat (1, 2), fractions of the top speed, ego frame.

        The action is 0 for a position-driven seat that commands no device.
        """
        if not self._driven[i].acts:
            return np.zeros((1, 2))
        return self._driven[i].act(self._world.known)

    def observed(self, i: int) -> Array | None:
        """Return the pucks that a driver observed last: positions and velocities.

        The rows are (pucks, 4), table frame, m and m/s. It is None for a person, and
        before the first action.
        """
        seen = self._driven[i].memory.get(SEEN)
        if seen is None:
            return None
        scene = self._world.scene
        rotation = scene.table.rotation(scene.seats[i].side)
        return np.hstack([seen[0, :, :2] @ rotation, seen[0, :, 2:] @ rotation])

    def prescribed(self) -> Array | None:
        """Return measured position and velocity of paddles (1, seats, 4), ego frame.

        Values are nan for seats that are not position-driven. Returns None if no seat
        is position-driven.
        """
        places = [seat.measured() for seat in self._driven]
        if all(place is None for place in places):
            return None
        asks = np.full((1, 4), np.nan)
        return np.stack([asks if place is None else place for place in places], 1)

    @property
    def troubles(self) -> list[str]:
        """Reason why a paddle that follows a person is at rest, by seat, or ""."""
        return [seat.driver.trouble for seat in self._driven]

    def close(self) -> None:
        """Close all drivers."""
        for seat in self._driven:
            seat.driver.__exit__(None, None, None)

    def _build(self, i: int) -> DrivenSeat:
        """Return the driver of a seat, with the handicap unless it is a person."""
        name, world = self.names[i], self._world
        driver = self._devices[i]
        if name != PERSON:
            driver = make_driver(name)
            if driver.needs_person and not driver.needs_device:
                raise ValueError(
                    f"{name} is the input device of a person; use {PERSON}"
                )
            live = world.live is not None
            refuse_erratic(f"paddle_{i}", driver, live)
        if name == PERSON or driver.needs_person or driver.needs_device:
            self.handicaps[i] = Handicap()
        else:
            driver = HandicappedDriver(driver, self.handicaps[i])
        return DrivenSeat(i, driver, world.observer, 1, world.control_dt)
