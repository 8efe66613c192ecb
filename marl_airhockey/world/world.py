"""World: one step function over B worlds, which all environments are views of."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from marl_airhockey.contracts.backend import Backend
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.core.state import State
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.control_step import ControlStep, Moment
from marl_airhockey.world.delay import Delay
from marl_airhockey.world.driven_seat import DrivenSeat
from marl_airhockey.world.episode import Episode, StepResult
from marl_airhockey.world.observer import Observation, Observer
from marl_airhockey.world.referee import Referee
from marl_airhockey.world.retired_seats import RetiredSeats
from marl_airhockey.world.sensor import Sensor
from marl_airhockey.world.set_state import checked_memory, settled


class World:
    """B worlds of one scenario on one backend.

    Worlds can be copied and pickled at any moment; the copy goes on by itself, to the
    same bit where the backend is `exact`.

    Args:
        scenario: what is played.
        backend: the physics, built for the scenario's scene.
        drivers: drivers of the seats that are not open, by seat index.
        physics: parameters and their ranges.
        observe: how pucks are shown to open seats, see `observable.OBSERVE`.
        max_cycles: length of an episode in control steps; None for the scenario's.
        autoreset: begin a new episode at once where one ended.
    """

    def __init__(
        self,
        scenario: Scenario,
        backend: Backend,
        drivers: Mapping[int, Driver],
        physics: Physics,
        observe: str = "velocity",
        max_cycles: int | None = None,
        autoreset: bool = True,
    ) -> None:
        self.scenario, self.backend, self.physics = scenario, backend, physics
        self.scene = scene = scenario.scene
        self.num_worlds = b = backend.num_worlds
        self.control_dt = dt = backend.control_dt
        self.autoreset, seats = autoreset, range(len(scene.seats))
        horizon = round(scenario.seconds / dt)
        self._limit = np.full(b, horizon if max_cycles is None else max_cycles)
        self.open = np.array([s for s in seats if s not in drivers], np.int64)
        self.reach = ReachPlanes.of(scene.table, scene.seats)
        self.sensor = Sensor(scene, b, physics, dt)
        self.observer = Observer(scenario, self.sensor, physics, observe)
        self.driven = [
            DrivenSeat(seat, driver, self.observer, b, dt)
            for seat, driver in sorted(drivers.items())
        ]
        self._referee = Referee(scenario, self.reach.rotation, self.observer.show)
        self._retired_seats = RetiredSeats(scene)
        shape, longest = (b, len(seats), 2), physics.highest("action_delay")
        self._delay = Delay(longest, dt, shape) if longest else None
        self.seeds = np.zeros(b, np.int64)
        """(B,) seed of each world"""
        self._seeded = False
        self._streams = {
            purpose: RandomStreams.keyed(self.seeds, self.seeds, purpose)
            for purpose in ("start", "physics", "sensor", "serve")
        }
        counts, flags = np.zeros((2, b), np.int64), np.zeros((b, len(seats)), np.bool_)
        number, cycles = (row.copy() for row in counts)
        first_shot, returns = np.zeros(b, np.bool_), np.zeros((b, len(seats)))
        self._episode = Episode(number, cycles, returns, flags, first_shot, {})
        self._state, self._memory = scene.still_state(b), Memory()
        self._sensed = self._state
        self._step: ControlStep | None = None
        self._parked = False

    # The arrays of a step are overwritten by the step after the next, so these copy.
    @property
    def state(self) -> State:
        """True state, table frame; freshly allocated."""
        return self._state.map(np.copy)

    @property
    def sensed(self) -> State:
        """State as the sensor sees it, table frame; freshly allocated."""
        return self._sensed.map(np.copy)

    @property
    def memory(self) -> Memory:
        """Memory of the scenario; freshly allocated."""
        return {name: array.copy() for name, array in self._memory.items()}

    @property
    def episode(self) -> Episode:
        """Counters of the running episodes; freshly allocated, but for the physics."""
        return self._episode.copied()

    @property
    def action(self) -> Array:
        """(B, seats, 2) actions of the last step, after their delay; a copy."""
        return self._built.action.copy()

    @property
    def command(self) -> Array:
        """(B, seats, 2) command of the last step, table frame, m/s; a copy."""
        return self._built.now.limited.velocity.copy()

    @property
    def max_cycles(self) -> int:
        """Length of an episode in control steps."""
        return int(self._limit[0])

    @max_cycles.setter
    def max_cycles(self, cycles: int) -> None:
        self._limit[:] = cycles

    @property
    def _built(self) -> ControlStep:
        if self._step is None:
            raise RuntimeError("step: call reset() first; no episode is running")
        return self._step

    def seed(self, seed: int) -> None:
        """Give world i the seed + i; takes effect at the next `reset`."""
        self.seeds = (np.arange(self.num_worlds) + seed).astype(np.int64)
        self._episode.number[:] = 0
        self._seeded = True

    def reset(self, seed: int | None = None) -> Observation:
        """Begin a new episode everywhere and return the first observation.

        The first one compiles the step, which takes some seconds once per machine.

        Args:
            seed: world i gets seed + i; None goes on with the streams it has (and
                draws a seed from the system the first time).
        """
        if seed is None and not self._seeded:
            seed = int(np.random.SeedSequence().generate_state(1)[0])
        if seed is not None:
            self.seed(seed)
        self.reset_worlds(np.arange(self.num_worlds))
        return self.observation()

    def reset_worlds(self, worlds: Array) -> None:
        """Begin a new episode in some worlds, by index (W,)."""
        number = self._episode.number
        number[worlds] += 1
        for purpose, stream in self._streams.items():
            stream.renew(worlds, self.seeds, number, purpose)
        self._draw_physics(worlds)
        rng = self._streams["start"].select(worlds)
        self._begin(worlds, *self.scenario.reset(rng, len(worlds)))
        for seat in self.driven:
            seat.reset(worlds, self.seeds, number)

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Observation:
        """Go on from a given state; return the observation of all worlds.

        It is as if every body had come here at its velocity and what touches had
        touched for long: no contact is new, the sensor's past is that of a steady
        motion, no delayed action is under way, and drivers begin anew. The clock is
        that of ``state.time``; returns and success begin at none. Episode, seed,
        physics and random streams go on.

        Args:
            state: of W worlds, (W, ...), as `get_state` gives it; or of one, without
                the leading axis.
            memory: of the scenario, as `get_state` gives it; None for that of an
                episode that begins here.
            worlds: (W,) indices; None for all.

        Raises:
            RuntimeError: before the first `reset`.
            ValueError: a wrong shape or a number that is not finite, named.
        """
        if self._step is None:
            raise RuntimeError("set_state: call reset() first, which draws the physics")
        worlds = np.arange(self.num_worlds) if worlds is None else np.asarray(worlds)
        rows = settled(state, self.scene, len(worlds))
        if memory is None:
            rng = self._streams["start"].select(worlds)
            memory = self.scenario.initial_memory(rows, rng)
        self._begin(worlds, rows, checked_memory(memory, self._memory, len(worlds)))
        self._episode.cycles[worlds] = np.round(rows.time / self.control_dt)
        for seat in self.driven:
            seat.begin(worlds)
        return self.observation()

    def get_state(self) -> tuple[State, Memory]:
        """Return the true state and the scenario's memory, which `set_state` takes."""
        return self.state, self.memory

    def _draw_physics(self, worlds: Array) -> None:
        """Draw the physics of the episodes that begin in some worlds, by index."""
        physics, stream = self._episode.physics, self._streams["physics"]
        if not physics:
            physics.update(self.physics.draw(stream))
            self.backend.set_physics(physics, np.arange(self.num_worlds))
        elif self.physics.varies:
            for name, value in self.physics.draw(stream.select(worlds)).items():
                physics[name][worlds] = value
            self.backend.set_physics(physics, worlds)

    def _begin(self, worlds: Array, rows: State, memory: Memory) -> None:
        """Begin an episode in some worlds, by index, from rows of state and memory."""
        if self._step is None:
            self._step = ControlStep(
                *(self.backend, self._referee, self.reach, self._limit),
                *(self._episode, rows, memory),
            )
            self._adopt(self._step.now)
        self._place(worlds, rows, memory)
        self._episode.begin(worlds)
        self._step.now.limited.acceleration[worlds] = 0.0
        if self._delay is not None:
            self._delay.fill(worlds, 0.0)
        self._sensed = self._sense(worlds)

    def _place(self, worlds: Array, rows: State, memory: Memory) -> None:
        """Put rows of a state and a memory into some worlds, by index."""
        self._state.write(worlds, rows)
        for name, row in memory.items():
            self._memory[name][worlds] = row
        self.backend.reset(self._state, worlds)

    def _adopt(self, moment: Moment) -> None:
        self._state, self._memory = moment.state, moment.verdict.memory
        self._episode = moment.episode

    def _sense(self, starting: Array | None = None) -> State:
        """Sense the state, beginning anew in some worlds, by index."""
        values, stream = self._episode.physics, self._streams["sensor"]
        if starting is None:
            return self.sensor.sense(self._state, values, stream)
        return self.sensor.reset(starting, self._state, values, stream)

    def observation(self) -> Observation:
        """Return what the open seats are shown now, freshly allocated."""
        return self.observer.read(self._sensed, self._memory, self.open)

    def step(self, actions: Array) -> StepResult:
        """Move all worlds by one control step.

        Args:
            actions: (B, open, 2) wanted velocities as fractions of top speed, ego
                frames.

        Raises:
            RuntimeError: before the first `reset`.
            ValueError: a wrong shape, or an element that is not finite.
        """
        step = self._built
        self._collect_actions(step, actions)
        if self._delay is not None:
            delay = self._episode.physics["action_delay"]
            step.action[:] = self._delay.push(step.action, delay)
        moment = step()
        self._adopt(moment)
        result = self._result(moment)
        self._finish_step(moment, result)
        return result

    def _collect_actions(self, step: ControlStep, actions: Array) -> None:
        """Fill the actions and prescribed motions of all seats, open and driven."""
        shape = (self.num_worlds, len(self.open), 2)
        if actions.shape != shape:
            raise ValueError(f"actions: expected shape {shape}, got {actions.shape}")
        if self._parked:
            step.prescribed[:], step.closed[:] = np.nan, False
            self._parked = False
        if not self.driven:
            step.action[:] = actions
        else:
            step.action[:, self.open] = actions
        for seat in self.driven:
            measured = seat.measured()
            if measured is None:
                step.action[:, seat.index] = seat.act(
                    self._sensed,
                    self._memory,
                    self._episode.physics,
                    self._episode.cycles,
                )
                continue
            rotation = self.reach.rotation[seat.index]
            step.action[:, seat.index], self._parked = 0.0, True
            step.prescribed[:, seat.index, :2] = measured[:, :2] @ rotation
            step.prescribed[:, seat.index, 2:] = measured[:, 2:] @ rotation
        retired = self.scenario.retired(self._memory)
        if retired is not None and retired.any():
            seats, self._parked = self._retired_seats, True
            seats.retire(retired, step.action, step.prescribed, step.closed)

    def _result(self, moment: Moment) -> StepResult:
        """Return what a step gives to the open seats, but for the observation."""
        outcome, terms = moment.verdict.outcome, moment.verdict.terms
        violation, success = moment.limited.violation.copy(), moment.episode.success
        reward, applied = outcome["reward"], outcome["applied_action"]
        rows = (reward, applied, violation[..., -1], success, *terms.values())
        if self.driven:
            rows = tuple(row[:, self.open] for row in rows)
        else:
            rows = tuple(row.copy() for row in rows)
        return StepResult(
            observation={},
            reward=rows[0],
            terminated=outcome["terminated"].copy(),
            truncated=outcome["truncated"].copy(),
            terms=dict(zip(terms, rows[4:], strict=True)),
            applied_action=rows[1],
            violation=violation,
            cost=rows[2],
            success=rows[3],
            first_shot=moment.episode.first_shot.copy(),
        )

    def _finish_step(self, moment: Moment, result: StepResult) -> None:
        """Sense, serve inside episodes, observe, and reset the worlds that ended."""
        self._sensed = self._sense()
        served, serves = None, moment.verdict.outcome.get("serves")
        if serves is not None and serves.any():
            served = np.flatnonzero(serves)
            rows = self._state.map(lambda x: x[served])
            memory = {name: array[served] for name, array in self._memory.items()}
            rng = self._streams["serve"].select(served)
            self._place(served, *self.scenario.serve(rng, rows, memory))
            self._sensed = self._sense(served)
        shown = {name: array.copy() for name, array in moment.verdict.shown.items()}
        if not shown:
            result.observation = self.observation()
        else:
            result.observation = self.observer.take(shown, self.open)
            if served is not None:
                result.observation = self._renewed(result.observation, served)
        ended = result.terminated | result.truncated
        if self.autoreset and ended.any():
            worlds = np.flatnonzero(ended)
            result.final_observation = result.observation
            self.reset_worlds(worlds)
            result.observation = self._renewed(result.observation, worlds)

    def _renewed(self, observation: Observation, worlds: Array) -> Observation:
        """Return an observation with that of some worlds, by index, read anew."""
        return self.observer.renewed(
            observation, self._sensed, self._memory, self.open, worlds
        )

    def close(self) -> None:
        """Close the backend and leave the drivers."""
        self.backend.close()
        for seat in self.driven:
            seat.driver.__exit__(None, None, None)
