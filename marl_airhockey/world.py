"""The one step function, over B worlds: drivers, delay, limits, backend, rewards.

Everything above (PettingZoo, Gymnasium, vector environments) is a thin view of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce

import numpy as np

from marl_airhockey.backend import Backend, Command
from marl_airhockey.draws import Draws
from marl_airhockey.driver import Driver
from marl_airhockey.episode import Episode, Step
from marl_airhockey.limits import Excess, Reach, limits
from marl_airhockey.observer import Observation, Observer
from marl_airhockey.physics import Physics
from marl_airhockey.scenario import Scenario
from marl_airhockey.seats import Driven
from marl_airhockey.sensor import Delay, Sensor
from marl_airhockey.state import Array, Memory, State, still_state


class World:
    """B worlds of one scenario on one backend.

    Args:
        scenario: what is played.
        backend: the physics, built for the scenario's cast.
        drivers: drivers of the seats that are not open, by seat index.
        physics: parameters and their ranges.
        observe: how pucks are shown to open seats, see `layout.OBSERVE`.
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
        self.cast = cast = scenario.cast
        self.num_worlds = b = backend.num_worlds
        self.control_dt = dt = backend.control_dt
        horizon = round(scenario.seconds / dt)
        self.max_cycles = horizon if max_cycles is None else max_cycles
        self.autoreset = autoreset
        seats = range(len(cast.seats))
        self.open = np.array([s for s in seats if s not in drivers], np.int64)
        self.reach = Reach.of(cast.table, cast.seats)
        self._to_ego = np.array([cast.table.rotation(s.side) for s in cast.seats])
        self._straight = bool((self._to_ego == np.eye(2)).all())
        self.sensor = Sensor(cast, b, physics, dt)
        self.observer = Observer(scenario, self.sensor, physics, observe)
        self.driven = [
            Driven(seat, driver, self.observer, b, dt)
            for seat, driver in sorted(drivers.items())
        ]
        n, longest = len(cast.seats), physics.highest("action_delay")
        self._delay = Delay(longest, dt, (b, n, 2)) if longest else None
        self._seeds = np.zeros(b, np.int64)
        self._seeded = False
        self.episode = Episode(
            np.zeros(b, np.int64),
            np.zeros(b, np.int64),
            np.zeros((b, n)),
            np.zeros((b, n), np.bool_),
            np.zeros(b, np.bool_),
        )
        self._streams: dict[str, Draws] = {}
        for purpose in ("start", "physics", "sensor", "serve"):
            self._streams[purpose] = Draws.keyed(self._seeds, self._seeds, purpose)
        self.state: State = still_state(cast.bodies, b, len(cast.mouths))
        self.memory: Memory = {}
        self._sensed = self.state
        self._pushed = np.zeros((b, n, 2))
        self.asked, self.sent = np.zeros((2, b, n, 2))

    asked: Array
    """(B, seats, 2) what was asked in the last step, after its delay: ego fractions"""
    sent: Array
    """(B, seats, 2) what was sent in the last step, table frame, m/s"""

    def seed(self, seed: int) -> None:
        """Give world i the seed + i; takes effect at the next `reset`."""
        self._seeds = (np.arange(self.num_worlds) + seed).astype(np.int64)
        self.episode.number[:] = 0
        self._seeded = True

    def reset(self, seed: int | None = None) -> Observation:
        """Begin a new episode everywhere and give the first observation.

        Args:
            seed: world i gets seed + i; None goes on with the streams it has (and
                draws a seed from the system the first time).
        """
        if seed is None and not self._seeded:
            seed = int(np.random.SeedSequence().generate_state(1)[0])
        if seed is not None:
            self.seed(seed)
        everywhere = np.ones(self.num_worlds, np.bool_)
        self.restart(everywhere)
        return self.observation()

    def restart(self, mask: Array) -> None:
        """Begin a new episode in the worlds of a mask (B,)."""
        episode, w = self.episode, int(mask.sum())
        episode.number[mask] += 1
        for purpose, stream in self._streams.items():
            stream.renew(mask, self._seeds, episode.number, purpose)
        if not episode.physics:
            episode.physics = self.physics.draw(self._streams["physics"])
            self.backend.set_physics(episode.physics, np.ones_like(mask))
        elif self.physics.varies:
            drawn = self.physics.draw(self._streams["physics"].select(mask))
            for name, value in drawn.items():
                episode.physics[name][mask] = value
            self.backend.set_physics(episode.physics, mask)
        rows, memory = self.scenario.start(self._streams["start"].select(mask), w)
        self._place(mask, rows, memory)
        for counter in (episode.cycles, episode.returns, episode.success):
            counter[mask] = 0
        episode.first_shot[mask] = False
        self._pushed[mask] = 0.0
        if self._delay is not None:
            idle = np.zeros((w, self._delay.depth, *self._pushed.shape[1:]))
            self._delay.fill(mask, idle)
        self._sensed = self._look(mask)
        for seat in self.driven:
            seat.start(mask, self._seeds, episode.number)

    def _place(self, mask: Array, rows: State, memory: Memory) -> None:
        """Put the worlds of a mask into rows of a state and a memory."""
        self.backend.start(rows, mask)
        if mask.all():
            self.state, self.memory = rows, memory
            return
        self.state = replace(self.state, path=None).scatter(mask, rows)
        merged = {}
        for name, row in memory.items():
            merged[name] = self.memory[name].copy()
            merged[name][mask] = row
        self.memory = merged

    def _look(self, starting: Array | None = None) -> State:
        """Sense the state, beginning anew in the worlds of a mask."""
        values, stream = self.episode.physics, self._streams["sensor"]
        if starting is None:
            return self.sensor.sense(self.state, values, stream)
        return self.sensor.start(starting, self.state, values, stream)

    def observation(self) -> Observation:
        """What the open seats are shown now."""
        return self.observer.read(self._sensed, self.memory, self.open)

    def step(self, actions: Array) -> Step:
        """Move all worlds by one control step.

        Args:
            actions: (B, open, 2) wanted velocities as fractions of top speed, ego
                frames.

        Raises:
            ValueError: a wrong shape, or an element that is not finite.
        """
        values, before, old = self.episode.physics, self.state, self.memory
        asked, told = self._ask(actions)
        if self._delay is not None:
            asked = self._delay.push(asked, values["action_delay"])
        speed = values["paddle_speed"]
        self.asked = asked
        wanted = asked * speed[:, None, None]
        if not self._straight:
            wanted = (wanted[..., None, :] @ self._to_ego)[..., 0, :]
        sent, excess = limits(
            wanted,
            before.paddle,
            before.paddle_velocity,
            self._pushed,
            self.reach,
            speed,
            values["paddle_acceleration"],
            self.control_dt,
        )
        if told is not None:
            np.copyto(sent, told[..., 2:], where=np.isfinite(told[..., 2:]))
        self.sent = sent
        after = self.backend.step(Command(sent, told))
        self._pushed = (sent - before.paddle_velocity) / self.control_dt
        new = self.scenario.advance(old, before, sent, after)
        terms = self.scenario.judge(before, sent, after, old, new)
        terminated = self.scenario.ends(after, new)
        self.state, self.memory = after, new
        truncated, reward = self._count(terms, terminated)
        result = self._report(terms, reward, terminated, truncated, sent, excess, speed)
        self._go_on(result)
        return result

    def _ask(self, actions: Array) -> tuple[Array, Array | None]:
        """What every seat asks, (B, seats, 2) ego fractions, and what some tell."""
        shape = (self.num_worlds, len(self.open), 2)
        if actions.shape != shape:
            raise ValueError(f"actions: expected shape {shape}, got {actions.shape}")
        if not self.driven:
            return actions.astype(np.float64), None
        asked = np.zeros((self.num_worlds, len(self.cast.seats), 2))
        asked[:, self.open] = actions
        told = None
        for seat in self.driven:
            place = seat.measured()
            if place is None:
                asked[:, seat.index] = seat.act(
                    self._sensed, self.memory, self.episode.physics, self.episode.cycles
                )
                continue
            if told is None:
                told = np.full((*asked.shape[:2], 4), np.nan)
            turn = self._to_ego[seat.index]
            told[:, seat.index, :2] = place[:, :2] @ turn
            told[:, seat.index, 2:] = place[:, 2:] @ turn
        return asked, told

    def _count(self, terms: dict[str, Array], terminated: Array) -> tuple[Array, Array]:
        """Update the counters; the truncations (B,) and rewards (B, seats)."""
        episode = self.episode
        episode.cycles += 1
        truncated = (episode.cycles >= self.max_cycles) & ~terminated
        reward = np.asarray(reduce(np.add, terms.values()))
        episode.returns += reward
        success = self.scenario.succeeds(self.state, self.memory)
        if success.ndim == 1:
            success = success[:, None]
        if success.any():
            fresh = success.any(-1) & ~episode.success.any(-1)
            if fresh.any() and "touches" in self.memory:
                few = self.memory["touches"].sum((-1, -2)) <= 1
                episode.first_shot |= fresh & few
            episode.success |= success
        return truncated, reward

    def _report(
        self,
        terms: dict[str, Array],
        reward: Array,
        terminated: Array,
        truncated: Array,
        sent: Array,
        excess: Excess,
        speed: Array,
    ) -> Step:
        turned = sent
        if not self._straight:
            turned = (self._to_ego @ sent[..., None])[..., 0]
        fraction = turned / speed[:, None, None]
        result = Step(
            observation={},
            reward=reward,
            terminated=terminated,
            truncated=truncated,
            terms=terms,
            sent=fraction.astype(np.float32),
            excess=excess,
            cost=excess.cost,
            success=self.episode.success,
            first_shot=self.episode.first_shot.copy(),
        )
        if self.driven:
            for name in ("reward", "sent", "cost", "success"):
                setattr(result, name, getattr(result, name)[:, self.open])
            result.terms = {k: v[:, self.open] for k, v in terms.items()}
        else:
            result.success = result.success.copy()
        return result

    def _go_on(self, result: Step) -> None:
        """Serve again inside episodes, sense, and restart the worlds that ended."""
        done = result.terminated | result.truncated
        self._sensed = self._look()
        served = self.scenario.restart(self._streams["serve"], self.state, self.memory)
        if served is not None:
            mask, rows, memory = served
            live = ~done[mask]
            mask = mask & ~done
            rows = rows.map(lambda x: x[live])
            self._place(mask, rows, {k: v[live] for k, v in memory.items()})
            self._sensed = self._look(mask)
        result.observation = self.observation()
        if self.autoreset and done.any():
            result.final_observation = result.observation
            self.restart(done)
            result.observation = self.observation()

    def close(self) -> None:
        """Close the backend and leave the drivers."""
        self.backend.close()
        for seat in self.driven:
            seat.driver.__exit__(None, None, None)
