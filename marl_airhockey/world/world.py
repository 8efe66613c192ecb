"""The one step function, over B worlds: drivers, delay, limits, backend, rewards.

Everything above (PettingZoo, Gymnasium, vector environments) is a thin view of it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.limits import Sent, limits
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.core.state import State, still_state
from marl_airhockey.jit.pipeline import NotCompilable
from marl_airhockey.jit.threads import spreads
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.delay import Delay
from marl_airhockey.world.driven_seat import Driven
from marl_airhockey.world.episode import Episode, StepResult
from marl_airhockey.world.observer import Observation, Observer
from marl_airhockey.world.referee import Referee, Verdict
from marl_airhockey.world.sensor import Sensor
from marl_airhockey.world.transition import Turn

PATIENCE = 50
"""Steps after which it is worth while to have a step compiled as a whole."""


class World:
    """B worlds of one scenario on one backend.

    Args:
        scenario: what is played.
        backend: the physics, built for the scenario's scene.
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
        self.scene = scene = scenario.scene
        self.num_worlds = b = backend.num_worlds
        self.control_dt = dt = backend.control_dt
        horizon = round(scenario.seconds / dt)
        self._limit = np.zeros(b, np.int64)
        self.max_cycles = horizon if max_cycles is None else max_cycles
        self.autoreset = autoreset
        seats = range(len(scene.seats))
        self.open = np.array([s for s in seats if s not in drivers], np.int64)
        self.reach = ReachPlanes.of(scene.table, scene.seats)
        table, sides = scene.table, [seat.side for seat in scene.seats]
        behind = table.offsets[sides] + 2 * table.paddle_radius
        self._parking = np.zeros((len(sides), 4))
        self._parking[:, :2] = -table.normals[sides] * behind[:, None]
        owners = [
            sides.index(m.side) if m.side in sides else -1 for m in scene.goal_lines
        ]
        self._owner = np.array(owners, np.int64)
        self.sensor = Sensor(scene, b, physics, dt)
        self.observer = Observer(scenario, self.sensor, physics, observe)
        self.referee = Referee(scenario, self.reach.turn, self.observer.show)
        self.driven = [
            Driven(seat, driver, self.observer, b, dt)
            for seat, driver in sorted(drivers.items())
        ]
        n, longest = len(scene.seats), physics.highest("action_delay")
        self._delay = Delay(longest, dt, (b, n, 2)) if longest else None
        self.seeds = np.zeros(b, np.int64)
        self._seeded = False
        self._episode = Episode(
            np.zeros(b, np.int64),
            np.zeros(b, np.int64),
            np.zeros((b, n)),
            np.zeros((b, n), np.bool_),
            np.zeros(b, np.bool_),
        )
        self._streams: dict[str, RandomStreams] = {}
        for purpose in ("start", "physics", "sensor", "serve"):
            self._streams[purpose] = RandomStreams.keyed(
                self.seeds, self.seeds, purpose
            )
        self._state: State = still_state(scene.bodies, b, len(scene.goal_lines))
        self._memory: Memory = {}
        self._sensed = self._state
        self._pushed = np.zeros((b, n, 2))
        self.action, self._sent = np.zeros((2, b, n, 2))
        self._steps = 0
        self._turn: Turn | None = None

    seeds: Array
    """(B,) of each world"""
    action: Array
    """(B, seats, 2) what was asked in the last step, after its delay: ego fractions"""

    # What a turn works on is overwritten by the step after the next, so what others get
    # is a copy.
    @property
    def state(self) -> State:
        """As it is, table frame."""
        return self._state if self._turn is None else self._state.map(np.copy)

    @property
    def sensed(self) -> State:
        """What the sensor makes of the state, table frame."""
        return self._sensed if self._turn is None else self._sensed.map(np.copy)

    @property
    def memory(self) -> Memory:
        """What the scenario remembers of the episode."""
        if self._turn is None:
            return self._memory
        return {name: array.copy() for name, array in self._memory.items()}

    @property
    def episode(self) -> Episode:
        """Counters of the running episodes."""
        return self._episode if self._turn is None else self._episode.copied()

    @property
    def command(self) -> Array:
        """(B, seats, 2) what was sent in the last step, table frame, m/s."""
        return self._sent if self._turn is None else self._sent.copy()

    @property
    def max_cycles(self) -> int:
        """Length of an episode in control steps."""
        return int(self._limit[0])

    @max_cycles.setter
    def max_cycles(self, cycles: int) -> None:
        self._limit[:] = cycles

    def seed(self, seed: int) -> None:
        """Give world i the seed + i; takes effect at the next `reset`."""
        self.seeds = (np.arange(self.num_worlds) + seed).astype(np.int64)
        self._episode.number[:] = 0
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
        self.restart(np.arange(self.num_worlds))
        return self.observation()

    def restart(self, worlds: Array) -> None:
        """Begin a new episode in some worlds, by index (W,)."""
        episode = self._episode
        episode.number[worlds] += 1
        for purpose, stream in self._streams.items():
            stream.renew(worlds, self.seeds, episode.number, purpose)
        if not episode.physics:
            episode.physics = self.physics.draw(self._streams["physics"])
            self.backend.set_physics(episode.physics, np.arange(self.num_worlds))
        elif self.physics.varies:
            drawn = self.physics.draw(self._streams["physics"].select(worlds))
            for name, value in drawn.items():
                episode.physics[name][worlds] = value
            self.backend.set_physics(episode.physics, worlds)
        rng = self._streams["start"].select(worlds)
        self._place(worlds, *self.scenario.start(rng, len(worlds)))
        for array in (episode.cycles, episode.returns):
            array[worlds] = 0
        for array in (episode.success, episode.first_shot):
            array[worlds] = False
        self._pushed[worlds] = 0.0
        if self._delay is not None:
            idle = np.zeros((len(worlds), self._delay.depth, *self._pushed.shape[1:]))
            self._delay.fill(worlds, idle)
        self._sensed = self._look(worlds)
        for seat in self.driven:
            seat.start(worlds, self.seeds, episode.number)

    def _place(self, worlds: Array, rows: State, memory: Memory) -> None:
        """Put some worlds into rows of a state and a memory."""
        if len(worlds) == self.num_worlds:
            self._state, self._memory = rows, memory
        else:
            self._state = self._state.write(worlds, rows, self.backend.rest_state)
            for name, row in memory.items():
                self._memory[name][worlds] = row
        self.backend.start(self._state, worlds)

    def _look(self, starting: Array | None = None) -> State:
        """Sense the state, beginning anew in some worlds, by index."""
        values, stream = self._episode.physics, self._streams["sensor"]
        if starting is None:
            return self.sensor.sense(self._state, values, stream)
        return self.sensor.start(starting, self._state, values, stream)

    def observation(self) -> Observation:
        """What the open seats are shown now."""
        return self.observer.read(self._sensed, self._memory, self.open)

    def step(self, actions: Array) -> StepResult:
        """Move all worlds by one control step.

        Args:
            actions: (B, open, 2) wanted velocities as fractions of top speed, ego
                frames.

        Raises:
            ValueError: a wrong shape, or an element that is not finite.
        """
        values, before = self._episode.physics, self._state
        action, prescribed = self._ask(actions)
        retired, closed = self.scenario.retired(self._memory), None
        if retired is not None and retired.any():
            action, prescribed = self._park(retired, action, prescribed)
            closed = retired[:, self._owner] & (self._owner >= 0)
        if self._delay is not None:
            action = self._delay.push(action, values["action_delay"])
        self.action = action
        if self._turn is None or prescribed is not None or closed is not None:
            after, sent, verdict = self._by_parts(action, prescribed, closed)
        else:
            after, sent, verdict = self._turn(
                action, before, self._memory, self._episode, self._pushed
            )
        self._sent, self._pushed = sent.velocity, sent.pushed
        vars(self._episode).update(verdict.counters)
        self._state, self._memory = after, verdict.memory
        result = self._report(verdict, sent.excess)
        self._go_on(result, verdict.shown)
        return result

    def _by_parts(
        self, action: Array, prescribed: Array | None, closed: Array | None
    ) -> tuple[State, Sent, Verdict]:
        """Limits, physics and judging of a step, one after the other."""
        values, before = self._episode.physics, self._state
        sent = limits(
            action,
            before.position,
            before.velocity,
            self._pushed,
            self.reach,
            values["paddle_speed"],
            values["paddle_acceleration"],
            self.control_dt,
        )
        if prescribed is not None:
            known = np.isfinite(prescribed[..., 2:])
            np.copyto(sent.velocity, prescribed[..., 2:], where=known)
            pushed = (sent.velocity - before.paddle_velocity) / self.control_dt
            sent = sent._replace(pushed=pushed)
        after = self.backend.step(Command(sent.velocity, prescribed, closed))
        verdict = self.referee.judge(
            before, sent.velocity, after, self._memory, self._episode, self._limit
        )
        self._steps += 1
        if self._steps == PATIENCE and not spreads(self.num_worlds):
            self._turn = self._compiled(after, verdict)
        return after, sent, verdict

    def _compiled(self, state: State, verdict: Verdict) -> Turn | None:
        """Steps like the last one as one compiled call, if that can be."""
        episode = self._episode.counted(verdict.counters)
        try:
            return Turn(
                self.backend,
                self.referee,
                self.reach,
                self._limit,
                state,
                verdict.memory,
                episode,
            )
        except NotCompilable:
            return None

    def _ask(self, actions: Array) -> tuple[Array, Array | None]:
        """What every seat asks, (B, seats, 2) ego fractions, and what some tell."""
        shape = (self.num_worlds, len(self.open), 2)
        if actions.shape != shape:
            raise ValueError(f"actions: expected shape {shape}, got {actions.shape}")
        if not self.driven:
            return actions.astype(np.float64), None
        action = np.zeros((self.num_worlds, len(self.scene.seats), 2))
        action[:, self.open] = actions
        prescribed, episode = None, self._episode
        for seat in self.driven:
            place = seat.measured()
            if place is None:
                action[:, seat.index] = seat.act(
                    self._sensed, self._memory, episode.physics, episode.cycles
                )
                continue
            if prescribed is None:
                prescribed = np.full((*action.shape[:2], 4), np.nan)
            turn = self.reach.turn[seat.index]
            prescribed[:, seat.index, :2] = place[:, :2] @ turn
            prescribed[:, seat.index, 2:] = place[:, 2:] @ turn
        return action, prescribed

    def _park(
        self, retired: Array, action: Array, prescribed: Array | None
    ) -> tuple[Array, Array]:
        """Asked and prescribed with the paddles of retired seats behind their sides."""
        prescribed = (
            np.full((*action.shape[:2], 4), np.nan)
            if prescribed is None
            else prescribed
        )
        prescribed[retired] = np.broadcast_to(self._parking, prescribed.shape)[retired]
        return np.where(retired[..., None], 0.0, action), prescribed

    def _report(self, verdict: Verdict, violation: Array) -> StepResult:
        outcome, episode, terms = verdict.outcome, self._episode, verdict.terms
        reward, sent, cost = outcome["reward"], outcome["sent"], violation[..., -1]
        success = episode.success.copy()
        if self.driven:
            rows = (reward, sent, cost, success)
            reward, sent, cost, success = (x[:, self.open] for x in rows)
            terms = {k: v[:, self.open] for k, v in terms.items()}
        return StepResult(
            observation={},
            reward=reward,
            terminated=outcome["terminated"],
            truncated=outcome["truncated"],
            terms=terms,
            applied_action=sent,
            violation=violation,
            cost=cost,
            success=success,
            first_shot=episode.first_shot.copy(),
        )

    def _go_on(self, result: StepResult, shown: dict[str, Array]) -> None:
        """Serve again inside episodes, sense, and restart the worlds that ended."""
        self._sensed = self._look()
        served = self.scenario.restart(
            self._streams["serve"], self._state, self._memory
        )
        worlds = np.empty(0, np.int64) if served is None else served[0]
        if served is not None and len(worlds):
            _, rows, memory = served
            live = ~(result.terminated | result.truncated)[worlds]
            if not live.all():
                worlds, rows = worlds[live], rows.map(lambda x: x[live])
                memory = {k: v[live] for k, v in memory.items()}
            self._place(worlds, rows, memory)
            self._sensed = self._look(worlds)
        if not shown:
            result.observation = self.observation()
        else:
            result.observation = self.observer.take(shown, self.open)
            if len(worlds):
                result.observation = self._renewed(result.observation, worlds)
        if not self.autoreset:
            return
        worlds = np.flatnonzero(result.terminated | result.truncated)
        if len(worlds):
            result.final_observation = result.observation
            self.restart(worlds)
            result.observation = self._renewed(result.observation, worlds)

    def _renewed(self, observation: Observation, worlds: Array) -> Observation:
        """The observation with that of some worlds read anew."""
        sensed = self._sensed.map(lambda x: x[worlds])
        memory = {k: v[worlds] for k, v in self._memory.items()}
        fresh = self.observer.read(sensed, memory, self.open, worlds=worlds)
        if isinstance(observation, np.ndarray):
            return _merged(observation, worlds, np.asarray(fresh))
        rows = dict(fresh)
        return {k: _merged(v, worlds, rows[k]) for k, v in observation.items()}

    def close(self) -> None:
        """Close the backend and leave the drivers."""
        self.backend.close()
        for seat in self.driven:
            seat.driver.__exit__(None, None, None)


def _merged(array: Array, worlds: Array, rows: Array) -> Array:
    """A copy in which some worlds, by index, hold ``rows``."""
    merged = array.copy()
    merged[worlds] = rows
    return merged
