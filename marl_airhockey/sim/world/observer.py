"""Observer: observations of all seats as arrays, dicts with goals, or images."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from marl_airhockey.sim.contracts.camera_model import CameraModel
from marl_airhockey.sim.contracts.observable import (
    EgoView,
    ObservationContext,
    ObservationLayout,
)
from marl_airhockey.sim.contracts.scenario import GoalScenario, Scenario
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Fused, Sink, Source
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.sim.sensing.images.camera_images import images_of
from marl_airhockey.sim.sensing.reaction import Parts, ReactionDelay, whole_steps
from marl_airhockey.sim.sensing.sensor import Sensor
from marl_airhockey.sim.world.hidden_pucks import HiddenPucks
from marl_airhockey.sim.world.observation import NOWHERE, Observation, replaced
from marl_airhockey.types import ALL, Array, Memory, Rows

GOALS = ("achieved_goal", "desired_goal")


class Observer:
    """Observer of all seats, with several observation types.

    If seats observe the true state, `stage` fills arrays as part of the control step.
    `read` returns any observation type for any seats and worlds.

    With a reaction time, a seat observes its own paddle immediately and everything else
    with this latency. `begin` and `note` must then be called with the sensed states.

    Args:
        scenario: Scenario, which defines observables and reaction time.
        sensor: Sensor, which stores the history.
        physics: Ranges of the physics parameters, for the top speed.
        forms: Observation types that can be read, see `observable.OBSERVE`. The first
            one is the type of the open seats.
        cameras: Cameras of the types that show one.

    Raises:
        ValueError: An observation type is unknown, its images need too much memory, or
            the reaction time is not a multiple of the control step.
    """

    def __init__(
        self,
        scenario: Scenario,
        sensor: Sensor,
        physics: Physics,
        forms: Collection[str],
        cameras: Mapping[str, CameraModel],
    ) -> None:
        self.scenario, self.sensor, self.forms = scenario, sensor, tuple(forms)
        self.observe = self.forms[0]
        """Observation type of the open seats."""
        self._top_speed = physics.highest("paddle_speed")
        steps = whole_steps(scenario.reaction, sensor.control_dt)
        self._delay = ReactionDelay.of(scenario, steps, sensor.control_dt)
        self._hidden = HiddenPucks.of(scenario, forms)
        self.reaction = steps * sensor.control_dt
        """Latency of observations by the rules of the game, s."""
        self.direct = self.observe == "velocity" and sensor.ideal and not self._delay
        """True if open seats observe the true state, so that `stage` fills it in."""
        self.images = images_of(scenario, forms, len(sensor.frames), cameras)
        """Images by observation type."""
        self._layouts: dict[str, ObservationLayout] = {}
        self._fused: dict[str, Fused] = {}
        self.layout_of(self.observe)

    def layout_of(self, form: str) -> ObservationLayout:
        """Return the layout of an observation type ("velocity" for images).

        Raises:
            ValueError: The worlds were not built for this observation type.
        """
        if form not in self.forms:
            raise ValueError(
                f"observe: {form!r} is not one of {', '.join(self.forms)}, types of "
                f"these worlds; build them with forms=({form!r},)"
            )
        if form not in self._layouts:
            scope = ObservationContext(
                self.scenario.scene,
                "velocity" if form in self.images else form,
                self._top_speed,
                self.reaction,
            )
            apart = self.scenario.goals == "dict"
            observables = tuple(
                p for p in self.scenario.observation if not (apart and p.goal)
            )
            self._layouts[form] = layout = ObservationLayout(observables, scope)
            if form not in self.images:
                show = partial(self._show, layout)
                self._fused[form] = Fused(show, self.scenario.name)
        return self._layouts[form]

    @property
    def layout(self) -> ObservationLayout:
        """Layout of the open seats' observations."""
        return self._layouts[self.observe]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the elements that open seats observe; none for images."""
        return () if self.observe in self.images else self.layout.labels

    def begin(self, worlds: Array, sensed: State, memory: Memory) -> None:
        """Begin an episode in some worlds; compile code that is not compiled yet.

        Args:
            worlds: Indices of the worlds (W,).
            sensed: Sensed state of all worlds, table frame.
            memory: Memory of the scenario in all worlds.
        """
        if self._delay is not None:
            self._delay.begin(worlds, self._parts(sensed, memory, worlds))
        for form, fused in self._fused.items():
            if not fused.prepared:
                fused.prepare(*self._sources(sensed, memory, form))
        for form, images in self.images.items():
            images.prepare(*self.pictured(sensed, memory, form))

    def note(self, sensed: State, memory: Memory) -> None:
        """Store the sensed state after a step, for later observations."""
        if self._delay is not None:
            self._delay.push(self._parts(sensed, memory, NOWHERE))

    def known(
        self, sensed: State, memory: Memory, form: str = "velocity"
    ) -> tuple[State, Memory]:
        """Return the state and the memory of all worlds that seats know now.

        Args:
            sensed: Current sensed state.
            memory: Current memory.
            form: "estimate" for estimated pucks, any other form for sensed ones.
        """
        estimate = form == "estimate"
        if self._delay is None:
            return self.sensor.estimated(sensed) if estimate else sensed, memory
        state = self._delay.delayed("estimate" if estimate else "state")
        return replace(sensed, **state), self._delay.delayed("memory")

    def prepare(self, state: State, memory: Memory) -> Sink:
        """Return arrays (B, seats, ...) for `stage` to fill; none if not `direct`."""
        if not self.direct:
            return {}
        fused = self._fused[self.observe]
        return fused.prepare(vars(state), memory, self.sensor.past())[0]

    def stage(self, state: State, memory: Memory, shown: Sink) -> list[Stage]:
        """Return the stage that fills ``shown`` from the true state, by reference.

        The list is empty if not `direct`.
        """
        if not self.direct:
            return []
        sources = vars(state), memory, self.sensor.past()
        return [self._fused[self.observe].stage(sources, (shown,))]

    def detached(
        self, sensed: State, memory: Memory, form: str
    ) -> tuple[Stage, dict[str, Array]]:
        """Return a stage that observes from arrays of its own, and these arrays.

        Args:
            sensed: Current sensed state, table frame.
            memory: Current memory.
            form: Observation type.

        Returns:
            Stage of all seats, and its arrays by name: ``state``, ``memory`` and
            ``sensor`` with the names of their elements, and ``observation``.
        """
        fused, sources = self._fused[form], self._sources(sensed, memory, form)
        copies = tuple(
            {k: v.copy() if isinstance(v, np.ndarray) else v for k, v in s.items()}
            for s in sources
        )
        (shown,) = fused.prepare(*copies)
        named = dict(zip(("state", "memory", "sensor"), copies, strict=True))
        arrays = {f"{of}.{k}": v for of, part in named.items() for k, v in part.items()}
        return fused.stage(copies, (shown,)), {**arrays, "observation": shown["flat"]}

    def read(
        self,
        sensed: State,
        memory: Memory,
        seats: Array,
        form: str | None = None,
        worlds: Rows = ALL,
        seen: State | None = None,
    ) -> Observation:
        """Return observations of some seats, in their order, in new arrays.

        Args:
            sensed: Sensed state of all worlds, table frame.
            memory: Memory of the scenario in all worlds.
            seats: Indices of the seats (n,).
            form: Observation type; None for the type of the open seats.
            worlds: Worlds to observe.
            seen: Positions and velocities in these worlds that are observed instead of
                the sensed ones, table frame; None for the sensed ones. Histories and
                images are always the sensed ones.
        """
        self.layout_of(form := form or self.observe)
        if form in self.images:
            shown = self.pictured(sensed, memory, form)
            return self.images[form].read(*shown, seats, worlds)
        fused, sources = self._fused[form], self._sources(sensed, memory, form)
        if seen is not None:
            sources[0].update(replaced(sources[0], seen, worlds))
        every = isinstance(worlds, slice)
        found = fused(*sources) if every else fused.at(np.asarray(worlds), *sources)
        return self.of_seats(found[0], seats)

    def of_seats(self, shown: Sink, seats: Array) -> Observation:
        """Select the observations of some seats; the arrays of all are not copied."""
        flat = shown["flat"]
        if len(seats) != len(self.scenario.scene.seats):
            flat = flat[:, seats]
        if len(shown) == 1:
            return flat
        return {"observation": flat} | {name: shown[name] for name in GOALS}

    def blank(self, form: str | None, rows: int) -> Observation:
        """Return observations of one seat that are all zeros (rows, ...).

        Args:
            form: Observation type; None for the type of the open seats.
            rows: Number of rows.
        """
        layout = self.layout_of(form := form or self.observe)
        if form in self.images:
            return self.images[form].blank(rows)
        flat, game = np.zeros((rows, len(layout.labels)), np.float32), self.scenario
        if game.goals == "flat" or not isinstance(game, GoalScenario):
            return flat
        shape = (rows, len(game.goal_bounds))
        return {"observation": flat} | {n: np.zeros(shape, np.float32) for n in GOALS}

    def _parts(self, sensed: State, memory: Memory, begun: Array) -> Parts:
        """Return the parts that are observed with the reaction time."""
        if self._hidden is not None:
            sensed = self._hidden.replaced(sensed, memory, begun)
        past = self.sensor.past() | {"frames": self.sensor.frames}
        parts = {"state": vars(sensed), "memory": memory, "sensor": past}
        if "estimate" in self.forms:
            parts["estimate"] = vars(self.sensor.estimated(sensed))
        return parts

    def _sources(
        self, sensed: State, memory: Memory, form: str
    ) -> tuple[dict[str, Any], Source, Source]:
        """Return the arrays of all worlds from which an observation is computed."""
        state, known = self.known(sensed, memory, form)
        sensor = self.sensor.past()
        if self._delay is not None:
            # A seat knows its own paddle and its last actions immediately.
            sensor["history"] = self._delay.delayed("sensor")["history"]
            # Compiled loops require contiguous arrays.
            own = sensed.paddle, sensed.paddle_velocity
            sensor["own"], sensor["own_velocity"] = map(np.ascontiguousarray, own)
        return dict(vars(state)), known, sensor

    def _show(
        self, layout: ObservationLayout, sensed: Source, memory: Memory, sensor: Source
    ) -> tuple[Sink]:
        """Return the elements of a layout and, with goals="dict", the goals."""
        game, state = self.scenario, State(**sensed)
        own = state.paddle, state.paddle_velocity
        if layout.scope.reaction:
            own = sensor["own"], sensor["own_velocity"]
        past = sensor["history"], sensor["requested"]
        shown = {"flat": layout.read(EgoView(state, memory, *past, own, layout.scope))}
        if game.goals == "dict" and isinstance(game, GoalScenario):
            goals = game.achieved(state, memory), game.desired(memory)
            for name, goal in zip(GOALS, goals, strict=True):
                shown[name] = goal[..., None, :].astype(np.float32)
        return (shown,)

    def pictured(
        self, sensed: State, memory: Memory, form: str
    ) -> tuple[Array, Source, Source]:
        """Return frames, state and memory, the arguments of `TableImages.collect`."""
        state, known, _ = self._sources(sensed, memory, form)
        past = self._delay.delayed("sensor") if self._delay else vars(self.sensor)
        photos = self.sensor.photos.get(form)
        return past["frames"] if photos is None else photos.rows, state, known
