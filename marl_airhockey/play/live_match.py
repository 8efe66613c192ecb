"""Live match: drivers, phases and clock, without the network."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Literal

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.match_drivers import MatchDrivers
from marl_airhockey.play.messages import description, drawn, events
from marl_airhockey.play.tally import Tally
from marl_airhockey.rollouts.columns import first_columns
from marl_airhockey.sim.contracts.image_form import shows_images
from marl_airhockey.sim.contracts.observable import OBSERVE
from marl_airhockey.sim.core.recording import Columns
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Memory

RATE = 60
"""Number of ticks and of control steps per second."""
COUNTDOWN = 3.0
"""Time from the start of a match to its first step, s."""
RESUME = 1.5
"""Shortest countdown after a pause, s."""
RETRY = 0.8
"""Countdown of another try of a task, s."""
Phase = Literal["lobby", "arrange", "countdown", "play", "goal", "pause", "done"]


class LiveMatch:
    """World with a driver for every seat, in the phases of a match.

    Args:
        scenario: Name of the scenario.
        drivers: `PERSON`, or name or path of a driver, by agent; a person for all other
            agents.
        keywords: Keywords of the environment, without drivers.
        handicap: Limits of drivers that are set without other limits; None for no
            limits.
        seed: Seed of the first episode.

    Raises:
        ValueError: The scenario, an agent or a driver does not exist.
    """

    CONTROL_DT = 1 / RATE
    """Default time between two actions, s."""

    def __init__(
        self,
        scenario: str,
        drivers: dict[str, str],
        keywords: Keywords,
        handicap: Handicap | None = None,
        seed: int | None = None,
    ) -> None:
        usual: Keywords = {"control_dt": self.CONTROL_DT}
        self.keywords: Keywords = {**usual, **keywords}
        self.scenario, self._rules = scenario, self.keywords
        self.world = self._build()
        agents = [f"paddle_{i}" for i in range(len(self.seats))]
        for agent in drivers:
            if agent not in agents:
                raise ValueError(
                    f"unknown agent {agent!r}; {scenario} has {', '.join(agents)}"
                )
        profile = self.keywords.get("profile", "ideal")
        self.drivers = MatchDrivers(self.world, profile)
        self.handicap = handicap or Handicap()
        """Limits of drivers that are set without other limits."""
        self.phase: Phase = "lobby"
        self.number = 0
        """Number of episodes."""
        self.ticks = 0
        """Number of control steps of this episode."""
        self.pauses = 0
        """Number of pauses of this episode."""
        self.time_left = 0.0
        """Rest of a countdown, or of the stop after a goal, s."""
        self.goal_stop = 0.0
        """Time for which play stops after a goal, so that pages can show it again, s;
        0 to continue."""
        self.mixed = False
        """True if a driver has changed during this episode."""
        self.reason = ""
        """Cause of a pause or of an abortion; "" for none."""
        self.events: list[list[Any]] = []
        """Rows ["goal", goal line, puck] and ["hit", paddle, puck] of the last tick."""
        self.result: StepResult | None = None
        """Result of the last control step of this episode; None before the first."""
        self.tally = Tally(len(self.seats))
        """Hits, shots and streaks of this episode."""
        self.first: Columns = {}
        """Columns (1, ...) of a recording before the first step of this episode."""
        self.world.seed(seed)
        self._next_episode()
        for agent, name in drivers.items():
            self.set_driver(agents.index(agent), name)

    @property
    def seats(self) -> tuple[Seat, ...]:
        """Seats of the scene."""
        return self.world.scene.seats

    @property
    def _decided_by(self) -> str:
        return self.world.scenario.decided_by(self._memory)

    @property
    def _memory(self) -> Memory:
        """Memory of the scenario, without the batch axis."""
        return {name: value[0] for name, value in self.world.memory.items()}

    @property
    def winners(self) -> list[int]:
        """Indices of the seats that are successful."""
        return np.flatnonzero(self.world.episode.success[0]).tolist()

    def set_driver(self, i: int, name: str, handicap: Handicap | None = None) -> None:
        """Set the driver of a seat, between matches.

        Args:
            i: Index of the seat.
            name: Name or path of the driver, or `PERSON`.
            handicap: Limits of the driver; None for those of the match.

        Raises:
            ValueError: A match is running, the name is unknown, or the policy does not
                fit.
        """
        if self.phase not in ("lobby", "done"):
            raise ValueError("drivers can only change between matches")
        self.drivers.set(i, name, self.handicap if handicap is None else handicap)
        if self.phase == "done":
            self.clear()
        else:
            self.drivers.reset([i])

    def replace_driver(self, i: int, name: str, handicap: Handicap) -> None:
        """Set the driver of a seat, even in a match.

        Raises:
            ValueError: The driver does not fit.
        """
        self.drivers.set(i, name, handicap)
        self.drivers.reset([i])
        self.mixed = self.ticks > 0

    def clear(self) -> None:
        """End a running match, and return to the lobby with the normal rules."""
        self.abort("cleared")
        if self.phase == "done":
            self._use(self._rules)
            self._next_episode()
            self.phase, self.reason = "lobby", ""

    def warm_up(self) -> None:
        """Play half a second and reset, so that all loops are compiled."""
        for _ in range(RATE // 2):
            self._step()
        self.world.seed(int(self.world.seeds[0]))
        self.phase, self.number = "lobby", 0
        self._next_episode()

    def start(self) -> None:
        """Start a match or resume a paused one with a countdown; end a stop."""
        if self.phase == "pause":
            self.phase, self.time_left = "countdown", max(self.time_left, RESUME)
        elif self.phase == "goal":
            self.phase, self.time_left = "play", 0.0
        elif self.phase in ("lobby", "done"):
            self._use(self._rules)
            again = self.phase == "done"
            if again:
                self._next_episode()
            is_retry = again and len(self.seats) == 1
            self.phase, self.time_left = "countdown", RETRY if is_retry else COUNTDOWN
        self.reason = ""

    @property
    def offers_golden_goal(self) -> bool:
        """True after a game that ended with the same number of goals for both teams."""
        over = self.phase == "done" and not self.reason
        names = [field.name for field in fields(self.world.scenario)]
        return over and "goals_to_win" in names and self._decided_by != "goals"

    def start_golden_goal(self) -> None:
        """Start a match that the next goal decides, with a countdown."""
        if self.offers_golden_goal:
            options = {**self._rules.get("options", {}), "goals_to_win": 1}
            self._use({**self._rules, "options": options})
            self._next_episode()
            self.phase, self.time_left = "countdown", COUNTDOWN

    def _use(self, keywords: Keywords) -> None:
        """Use the rules of some keywords from the next episode on."""
        if keywords != self.keywords:
            self.world.close()
            self.keywords = keywords
            self.world = self._build()
            self.world.seed(None)
            self.drivers.enter(self.world)
            self._next_episode()

    def _build(self) -> World:
        # Policies with any observation type can take a seat at any time, except images,
        # which no policy of the zoo uses.
        forms = [form for form in OBSERVE if not shows_images(form)]
        return build_world(self.scenario, 1, False, self.keywords, forms)

    def pause(self, reason: str = "") -> None:
        """Pause a running match."""
        if self.phase in ("play", "countdown", "goal"):
            self.phase, self.reason = "pause", reason
            self.pauses += 1

    def abort(self, reason: str) -> None:
        """End a match early, without a winner."""
        if self.phase in ("play", "countdown", "goal", "pause"):
            self.phase, self.reason = "done", reason

    def tick(self) -> bool:
        """Advance the clock by 1 / `RATE` s; return True if the world was stepped."""
        self.events = []
        if self.phase in ("countdown", "goal"):
            self.time_left -= 1 / RATE
            if self.time_left <= 1e-9:
                self.phase, self.time_left = "play", 0.0
        if self.phase != "play":
            return False
        self._step()
        scored = any(kind == "goal" for kind, *_ in self.events)
        if self.phase == "play" and scored and self.goal_stop:
            self.phase, self.time_left = "goal", self.goal_stop
        return True

    def close(self) -> None:
        """Close the drivers and the world."""
        self.drivers.close()
        self.world.close()

    def state(self) -> dict[str, Any]:
        """Return the data that a page draws: `messages.drawn`, with phase and clock.

        ``n`` counts the steps of the episode. ``time_left`` is the rest of a countdown,
        s.
        """
        world, episode = self.world, self.world.episode
        state = world.state.map(lambda x: x[0])
        shown = episode.returns[0], episode.success[0]
        return {
            "phase": self.phase,
            "n": self.ticks,
            "time_left": round(self.time_left, 2),
            **drawn(world.scenario, state, self._memory, *shown),
            "reason": self.reason,
            "golden_goal": self.keywords != self._rules,
            "offers_golden_goal": self.offers_golden_goal,
            "events": self.events,
            "tally": self.tally.state() if self.phase == "done" else None,
            "mixed": self.mixed,
        }

    def describe(self) -> dict[str, Any]:
        """Return the constant data of a match: `messages.description`."""
        world = self.world
        return description(world.scenario, world.max_cycles * world.control_dt)

    def _next_episode(self) -> None:
        """Start the next episode of the world."""
        self.world.reset()
        self._begin_episode()

    def _begin_episode(self) -> None:
        """Reset counters and drivers after a reset of the world."""
        self.ticks, self.pauses, self.result, self.events = 0, 0, None, []
        self.mixed, self.tally = False, Tally(len(self.seats))
        self.number += 1
        self.drivers.reset(range(len(self.seats)))
        self.first = first_columns(self.world)

    def _step(self) -> None:
        """Step the world once and store its events."""
        world = self.world
        actions = np.zeros((1, len(self.seats), 2))
        for i in range(len(self.seats)):
            actions[:, i] = self.drivers.action(i)
        self.result = world.step(actions, self.drivers.prescribed())
        self.ticks += 1
        state = world.state.map(lambda x: x[0])
        self.events = events(state)
        self.tally.note(world.scenario, state, self._memory)
        if self.result.terminated[0] or self.result.truncated[0]:
            self.phase, self.reason = "done", ""
