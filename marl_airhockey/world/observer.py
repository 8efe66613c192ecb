"""Observer: shows sensed states to seats, as arrays, dicts of goals, or pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from marl_airhockey.contracts.observable import (
    FRAMES,
    OBSERVE,
    EgoView,
    ObservationContext,
)
from marl_airhockey.contracts.scenario import GoalScenario, Scenario
from marl_airhockey.core.errors import unknown_name
from marl_airhockey.core.physics import Physics
from marl_airhockey.core.state import State
from marl_airhockey.jit.fused import Fused, Sink, Source
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.delay import ALL, Rows
from marl_airhockey.world.layout import ObservationLayout
from marl_airhockey.world.perception import Parts, Perception
from marl_airhockey.world.sensor import Sensor

Observation = Array | Mapping[str, Array]
"""(B, seats, D) float32, (B, seats, 84, 84, 3) uint8, or a dict of goals."""
PIXELS = 84
GOALS = ("achieved_goal", "desired_goal")


class Observer:
    """Observer of sensed states for all seats, in the form that each of them wants.

    With a reaction, all but a seat's own paddle is shown as it was then; `begin` and
    `note` must be called with what is sensed.

    Args:
        scenario: lists the observables, and says how late seats see.
        sensor: keeps the history.
        physics: tells the top speed.
        observe: the form for open seats, see `layout.OBSERVE`.
    """

    def __init__(
        self, scenario: Scenario, sensor: Sensor, physics: Physics, observe: str
    ) -> None:
        self.scenario, self.sensor, self.observe = scenario, sensor, observe
        self._top_speed = physics.highest("paddle_speed")
        steps = round(scenario.reaction / sensor.control_dt)
        if abs(steps * sensor.control_dt - scenario.reaction) > 1e-6:
            near = [k * sensor.control_dt for k in (steps, steps + 1)]
            raise ValueError(
                f"reaction: {scenario.reaction:g} s is no multiple of control_dt, "
                f"{sensor.control_dt:g} s; give another control_dt or an option, e.g. "
                f'options={{"reaction": {near[0]:g}}} or {near[1]:g}'
            )
        self._perception = Perception(steps) if steps else None
        self.reaction = steps * sensor.control_dt
        """s by which seats see late"""
        self._layouts: dict[str, ObservationLayout] = {}
        self._shows: dict[str, Fused] = {}
        self.prepare(observe)

    def prepare(self, observe: str) -> ObservationLayout:
        """Return the layout of a form; pictures have that of velocities beside them."""
        if observe not in OBSERVE:
            raise ValueError(unknown_name("observe", observe, OBSERVE))
        self.sensor.keeps_history |= observe != "velocity"
        self.sensor.estimates |= observe == "estimate"
        if observe not in self._layouts:
            form = "velocity" if observe == "pixels" else observe
            scope = ObservationContext(
                self.scenario.scene, form, self._top_speed, self.reaction
            )
            apart = self.scenario.goals == "dict"
            observables = tuple(
                p for p in self.scenario.observation if not (apart and p.goal)
            )
            self._layouts[observe] = layout = ObservationLayout(observables, scope)
            self._shows[observe] = self._compiled(layout)
        return self._layouts[observe]

    @property
    def layout(self) -> ObservationLayout:
        """Layout of the open seats' observations."""
        return self._layouts[self.observe]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the numbers that open seats are shown; none for pictures."""
        return () if self.observe == "pixels" else self.layout.labels

    def compile(self, sensed: State, memory: Memory) -> None:
        """Compile all forms of observations, unless they are, for arrays like these."""
        for form, show in self._shows.items():
            if not show.prepared:
                show.prepare(*self._sources(sensed, memory, form))

    def begin(self, worlds: Array, sensed: State, memory: Memory) -> None:
        """Begin with what is sensed in some worlds, by index; arrays are of all."""
        if self._perception is not None:
            self._perception.begin(worlds, self._parts(sensed, memory))

    def note(self, sensed: State, memory: Memory) -> None:
        """Take note of what is sensed after a step."""
        if self._perception is not None:
            self._perception.push(self._parts(sensed, memory))

    def _parts(self, sensed: State, memory: Memory) -> Parts:
        """Return what is seen late."""
        past = {**self.sensor.past(), "frames": self.sensor.frames}
        parts = {"state": vars(sensed), "memory": memory, "sensor": past}
        if self.sensor.estimates:
            parts["estimate"] = vars(self.sensor.estimated(sensed))
        return parts

    def seen(
        self, sensed: State, memory: Memory, form: str = "velocity"
    ) -> tuple[State, Memory]:
        """Return the state and the memory of all worlds as seats see them.

        Args:
            sensed: now.
            memory: now.
            form: see `observable.OBSERVE`; "estimate" for estimated pucks.
        """
        if self._perception is None:
            estimate = form == "estimate"
            return self.sensor.estimated(sensed) if estimate else sensed, memory
        seen = self._perception.seen
        state = seen("estimate" if form == "estimate" else "state")
        return replace(sensed, **state), seen("memory")

    def _sources(
        self, sensed: State, memory: Memory, form: str
    ) -> tuple[Source, Source, Source]:
        """Return the arrays of all worlds from which a form of observations is made."""
        state, known = self.seen(sensed, memory, form)
        sensor = self.sensor.past()
        if self._perception is not None:
            # The own paddle, and what it was asked for, are known at once.
            sensor["history"] = self._perception.seen("sensor")["history"]
            # Contiguous, as compiled loops take them.
            own = sensed.paddle, sensed.paddle_velocity
            sensor["place"], sensor["motion"] = map(np.ascontiguousarray, own)
        return vars(state), known, sensor

    def read(
        self,
        sensed: State,
        memory: Memory,
        seats: Array,
        observe: str | None = None,
        worlds: Rows = ALL,
    ) -> Observation:
        """Return observations of some seats, in their order, freshly allocated.

        Args:
            sensed: the sensed state of all worlds, table frame.
            memory: the scenario's, of all worlds.
            seats: (n,) indices of seats.
            observe: the form; None for the open seats'.
            worlds: which of them to show.
        """
        observe = observe or self.observe
        if observe == "pixels":
            return self._pictures(memory, seats, worlds)
        self.prepare(observe)
        show, sources = self._shows[observe], self._sources(sensed, memory, observe)
        every = isinstance(worlds, slice)
        (shown,) = show(*sources) if every else show.at(np.asarray(worlds), *sources)
        return self.take(shown, seats)

    def blank(self, observe: str | None, rows: int) -> Observation:
        """Return observations of one seat that are all zeros, (rows, ...) each.

        Args:
            observe: the form; None for the open seats'.
            rows: their number.
        """
        observe = observe or self.observe
        if observe == "pixels":
            return np.zeros((rows, PIXELS, PIXELS, FRAMES), np.uint8)
        size = len(self.prepare(observe).labels)
        flat, game = np.zeros((rows, size), np.float32), self.scenario
        if game.goals == "flat" or not isinstance(game, GoalScenario):
            return flat
        shape = (rows, len(game.goal_bounds))
        goals = {n: np.zeros(shape, np.float32) for n in GOALS}
        return {"observation": flat, **goals}

    def take(self, shown: Sink, seats: Array) -> Observation:
        """Return the observations of some seats from those of all, used up."""
        if len(seats) != len(self.scenario.scene.seats):
            shown["flat"] = shown["flat"][:, seats]
        if len(shown) == 1:
            return shown["flat"]
        flat = shown.pop("flat")
        return {"observation": flat, **shown}

    def show(self, state: State, memory: Memory) -> Sink:
        """Return the observations of all seats from the true state.

        Empty if they need the sensor, a history or pixels (`read` is used then).
        """
        late = self._perception is not None
        if self.observe != "velocity" or not self.sensor.ideal or late:
            return {}
        return self._flat(self.layout, state, memory, self.sensor.past())

    def _flat(
        self, layout: ObservationLayout, state: State, memory: Memory, past: Source
    ) -> Sink:
        """Return the numbers of a layout, and the goals beside it."""
        game = self.scenario
        paddle = state.paddle, state.paddle_velocity
        if layout.scope.reaction:
            paddle = past["place"], past["motion"]
        sensed = past["history"], past["asked"]
        ego = EgoView(state, memory, *sensed, paddle, layout.scope)
        shown = {"flat": layout.read(ego)}
        if game.goals == "dict" and isinstance(game, GoalScenario):
            goals = game.achieved(state, memory), game.desired(memory)
            for name, goal in zip(GOALS, goals, strict=True):
                shown[name] = goal[..., None, :].astype(np.float32)
        return shown

    def _compiled(self, layout: ObservationLayout) -> Fused:
        """Return `_flat` of sources, as one loop over the worlds."""
        return Fused(partial(self._show, layout), self.scenario.name)

    def _show(
        self, layout: ObservationLayout, sensed: Source, memory: Memory, sensor: Source
    ) -> tuple[Sink]:
        return (self._flat(layout, State(**sensed), memory, sensor),)

    def after_step(
        self,
        shown: Sink,
        sensed: State,
        memory: Memory,
        seats: Array,
        served: Array | None,
    ) -> Observation:
        """Return the observations of some seats after a step, freshly allocated.

        Args:
            shown: result of `show` for the new state.
            sensed: the sensed state of all worlds, table frame.
            memory: the scenario's, of all worlds.
            seats: (n,) indices of seats.
            served: worlds, by index, whose state has changed since; None for none.
        """
        if not shown:
            return self.read(sensed, memory, seats)
        own = {name: array.copy() for name, array in shown.items()}
        observation = self.take(own, seats)
        if served is not None:
            self.renew(observation, sensed, memory, seats, served)
        return observation

    def renew(
        self,
        observation: Observation,
        sensed: State,
        memory: Memory,
        seats: Array,
        worlds: Array,
    ) -> None:
        """Read an observation anew in some worlds, in place.

        Args:
            observation: of all worlds.
            sensed: the sensed state of all worlds, table frame.
            memory: the scenario's, of all worlds.
            seats: (n,) indices of seats.
            worlds: (W,) indices.
        """
        fresh: Observation
        if self.observe == "pixels":
            fresh = self._pictures(memory, seats, worlds)
        else:
            sources = self._sources(sensed, memory, self.observe)
            (shown,) = self._shows[self.observe].at(worlds, *sources)
            fresh = self.take(shown, seats)
        if isinstance(observation, np.ndarray):
            observation[worlds] = fresh
        else:
            for name, array in observation.items():
                array[worlds] = fresh[name]

    def _pictures(self, memory: Memory, seats: Array, worlds: Rows) -> Array:
        from marl_airhockey.world.pixels import pictures_of

        frames, goals = self.sensor.frames, memory.get("goal")
        if self._perception is not None:
            frames = self._perception.seen("sensor")["frames"]
        if goals is not None:
            goals = goals[worlds]
        return pictures_of(self.scenario.scene, frames[worlds], goals, seats, PIXELS)


def duplicate(observation: Observation) -> Observation:
    """Return a copy of an observation, which shares no array with it."""
    if isinstance(observation, np.ndarray):
        return observation.copy()
    return {name: array.copy() for name, array in observation.items()}
