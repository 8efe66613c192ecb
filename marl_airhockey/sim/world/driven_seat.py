"""Driven seat: a seat that a driver inside the environment controls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.rng import StreamSet
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.known import Known
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.sim.world.observer import Observer
from marl_airhockey.types import ALL, Array, Rows


class DrivenSeat:
    """Seat of B worlds that a driver controls, with the memory of the driver.

    Args:
        index: Index of the seat.
        driver: Driver, which is entered as a context manager.
        observer: Observer of the worlds.
        num_worlds: Number of worlds, B.
        control_dt: Length of a control step, s.

    Raises:
        ValueError: The driver's ``control_dt`` is no multiple of the control step, or
            the driver cannot act on its observations.
    """

    def __init__(
        self,
        index: int,
        driver: Driver,
        observer: Observer,
        num_worlds: int,
        control_dt: float,
    ) -> None:
        self.index, self.driver, self._observer = index, driver, observer
        scene = observer.scenario.scene
        self._seat = scene.seats[index]
        self._rotation = scene.table.rotation(self._seat.side)
        own = driver.control_dt or control_dt
        self.every, self._own_dt = round(own / control_dt), own
        if self.every < 1 or abs(self.every * control_dt - own) > 1e-9:
            raise ValueError(
                f"driver of paddle_{index}: its control_dt {own} s is not a multiple "
                f"of the environment's {control_dt} s"
            )
        self._layout = observer.layout_of(driver.observe or observer.observe)
        driver.check(observer.blank(driver.observe, 3))
        self._num_worlds = num_worlds
        self._purpose = f"driver {index}"
        self._streams = StreamSet(num_worlds, self._purpose)
        self._held = np.zeros((num_worlds, 2))
        self._memory: dict[str, Array] = {}
        driver.__enter__()

    def reset(self, worlds: Array, seeds: Array, episodes: Array) -> None:
        """Begin an episode in some worlds, by index (W,), with new random streams."""
        self._streams.renew(worlds, seeds, episodes)
        self.begin(worlds)

    def begin(self, worlds: Array) -> None:
        """Begin an episode in some worlds, by index (W,), with the same streams."""
        self._held[worlds] = 0.0
        rng = self._streams.of(self._purpose, worlds)
        self._keep(self.driver.reset(self._seat, rng, len(worlds)), worlds)

    def _keep(self, rows: Mapping[str, Array], worlds: Rows) -> None:
        """Store the memory of the driver in some worlds."""
        for name, row in rows.items():
            if name not in self._memory:
                shape = (self._num_worlds, *row.shape[1:])
                self._memory[name] = np.zeros(shape, row.dtype)
            self._memory[name][worlds] = row

    @property
    def memory(self) -> Mapping[str, Array]:
        """Memory of the driver, arrays (B, ...)."""
        return self._memory

    @property
    def acts(self) -> bool:
        """True if `act` must be called, for an action or to command a device."""
        return self.driver.commands_device or self.driver.measured() is None

    def measured(self) -> Array | None:
        """Return the measured paddle (B, 4), ego frame; None if it follows actions."""
        return self.driver.measured()

    def act(self, known: Known, worlds: Rows = ALL) -> Array:
        """Return actions in some worlds (W, 2), in units of top speed, ego frame."""
        due, held = known.cycles[worlds] % self.every == 0, self._held[worlds]
        if not due.any():
            return held
        view = self.view(known, worlds)
        kept = {name: value[worlds] for name, value in self._memory.items()}
        answer = self.driver.act(view, kept)
        who = f"driver of paddle_{self.index} ({type(self.driver).__name__})"
        if not (isinstance(answer, tuple) and len(answer) == 2):
            raise ValueError(f"{who}: act() must return (action, memory)")
        action, kept = answer
        if action.shape != held.shape:
            raise ValueError(
                f"{who}: act() must return an action of shape {held.shape}, got "
                f"{action.shape}"
            )
        if not np.isfinite(action).all():
            raise ValueError(
                f"{who}: act() returned nan or inf; actions must be finite"
            )
        self._keep(kept, worlds)
        self._held[worlds] = np.where(due[:, None], action, held)
        return self._held[worlds]

    def view(self, known: Known, worlds: Rows = ALL) -> View:
        """Return the view of the driver in some worlds, with one row for each world."""
        sensed = known.sensed

        def read(seen: State | None) -> Observation:
            seats, form = np.array([self.index]), self.driver.observe
            if seen is not None:
                seen = self._in_table_frame(seen, state)
            shown = self._observer.read(sensed, known.memory, seats, form, worlds, seen)
            if isinstance(shown, Mapping):
                return {name: array[:, 0] for name, array in shown.items()}
            return np.asarray(shown)[:, 0]

        state, memory = self._observer.known(sensed, known.memory)
        if worlds is not ALL:
            state = state.map(lambda x: x[worlds])
            memory = {name: value[worlds] for name, value in memory.items()}
        position, velocity = state.position, state.velocity
        if self._observer.reaction:
            position, velocity = position.copy(), velocity.copy()
            position[:, self.index] = sensed.position[worlds, self.index]
            velocity[:, self.index] = sensed.velocity[worlds, self.index]
        if self._rotation[0, 0] != 1.0:
            position = products(position, self._rotation)
            velocity = products(velocity, self._rotation)
        return View(
            scene=self._observer.scenario.scene,
            state=replace(state, position=position, velocity=velocity),
            read=read,
            labels=self._layout.labels,
            top_speed=known.physics["paddle_speed"][worlds],
            reach=np.asarray(self._seat.reach),
            rng=self._streams.of(self._purpose).select(worlds),
            seat=self.index,
            control_dt=self._own_dt,
            scenario_memory=memory,
            reaction=self._observer.reaction,
        )

    def _in_table_frame(self, seen: State, state: State) -> State:
        """Return a state in the table frame, with the own paddle of another state.

        Args:
            seen: State (W, ...), ego frame.
            state: State (W, ...) with the own paddle at the time of the other bodies,
                table frame.
        """
        rows = []
        for name in ("position", "velocity"):
            row = products(getattr(seen, name), self._rotation.T)
            row[:, self.index] = getattr(state, name)[:, self.index]
            rows.append(row)
        return replace(seen, position=rows[0], velocity=rows[1])
