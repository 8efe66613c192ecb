"""One table that is played at: its seats, its phases, its clock. No network here."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any, Literal

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.core.seat import Seat
from marl_airhockey.envs.describe import what
from marl_airhockey.play.handicap import Fairness
from marl_airhockey.registry import (
    ZOO,
    agent_names,
    find_backend,
    make_agent,
    make_scenario,
    zoo_names,
)
from marl_airhockey.toolkit.numpy_policy import NumpyPolicy
from marl_airhockey.types import Array
from marl_airhockey.world.build import Keywords, build_world
from marl_airhockey.world.driven_seat import DrivenSeat
from marl_airhockey.world.episode import StepResult

RATE = 60
"""Ticks, and control steps, per second."""


COUNTDOWN = 3.0
"""s before the puck is free."""


RESUME = 1.5
"""s before a paused match goes on."""


PERSON = "person"
"""What a seat is called that people take."""


Phase = Literal["lobby", "countdown", "play", "pause", "done"]


HANDS = ("mouse", "gamepad")
"""Drivers that people steer."""


class Court:
    """A world of which every seat is driven, in the phases of a match.

    Args:
        scenario: its name.
        seats: who sits where, by agent: `PERSON`, or a driver's name or path.
        keywords: of the environment, without drivers.
        fairness: of all programs.
        seed: of the first episode.

    Raises:
        ValueError: an unknown scenario, agent or driver.
    """

    def __init__(
        self,
        scenario: str,
        seats: dict[str, str],
        keywords: Keywords,
        fairness: Fairness | None = None,
        seed: int | None = None,
    ) -> None:
        backend = find_backend(keywords.get("backend", "pymunk"))
        substeps = 4 if backend.ideal else 16
        usual: Keywords = {"control_dt": 1 / RATE, "substeps": substeps}
        self.keywords: Keywords = {**usual, **keywords}
        self.world = build_world(scenario, 1, autoreset=False, keywords=self.keywords)
        self.scene = self.world.scene
        self.fairness = fairness if fairness is not None else Fairness()
        agents = [f"paddle_{i}" for i in range(len(self.scene.seats))]
        for agent in seats:
            if agent not in agents:
                raise ValueError(
                    f"seat {agent!r} is unknown; {scenario} has {', '.join(agents)}"
                )
        self.who = [PERSON for _ in agents]
        self._hands: list[Driver] = [make_agent("mouse") for _ in agents]
        self._kinds = ["mouse" for _ in agents]
        self._driven = [self._sit(i) for i in range(len(agents))]
        self.phase: Phase = "lobby"
        self.opening: dict[str, Any] = {}
        """What `state` was before the first step of this episode."""
        self.number, self.ticks, self.left, self.pauses = 0, 0, 0.0, 0
        self.reason = ""
        self.events: list[list[Any]] = []
        self.result: StepResult | None = None
        self._turns = np.array([self.scene.table.rotation(s.side) for s in self.seats])
        self.world.reset(seed)
        self._begin()
        for agent, name in seats.items():
            self.seat(agents.index(agent), name)

    @property
    def seats(self) -> tuple[Seat, ...]:
        """The seats of the scene."""
        return self.scene.seats

    @property
    def choices(self) -> list[str]:
        """Who may be asked to play: scripts, and the zoo's policies for this game."""
        scripts = [n for n in agent_names() if n not in (*HANDS, "policy", "reacher")]
        strengths = [
            f"{name}:strength={strength}"
            for name in ("allround", "striker", "goalkeeper")
            for strength in ("weak", "fair")
        ]
        return [*self.house, *scripts, *(strengths if len(self.seats) > 1 else [])]

    @cached_property
    def house(self) -> list[str]:
        """The zoo's policies that can play this: same rules, seats and observations."""
        scenario, observer = self.world.scenario, self.world.observer
        found: list[tuple[bool, str]] = []
        for name in zoo_names():
            card = NumpyPolicy.load(ZOO / f"{name[4:]}.npz").card
            labels = observer.prepare(card["observe"]).labels
            kind = make_scenario(card["scenario"], **card["options"]).seats
            if (card["scenario"], card["labels"], kind) == (
                scenario.name,
                list(labels),
                scenario.seats,
            ):
                other = card["profile"] != self.keywords.get("profile", "ideal")
                found.append((other, name))
        return [name for _, name in sorted(found)]

    def _sit(self, i: int) -> DrivenSeat:
        """The driver of a seat as the world calls it."""
        name, world = self.who[i], self.world
        driver = self._hands[i]
        if name != PERSON:
            driver = self.fairness.hold(make_agent(name))
        return DrivenSeat(i, driver, world.observer, 1, world.control_dt)

    def seat(self, i: int, name: str) -> None:
        """Give a seat to somebody else; between matches.

        Raises:
            ValueError: during a match, or an unknown name.
        """
        if self.phase not in ("lobby", "done"):
            raise ValueError("seats change between matches")
        if name in HANDS:
            raise ValueError(f"{name} is what a person steers with: say {PERSON}")
        before, driven = self.who[i], self._driven[i]
        self.who[i] = name
        try:
            self._driven[i] = self._sit(i)
            self._start_drivers([i])
            self._ask(i)  # A policy that does not fit says so here, not in a match.
        except ValueError:
            self.who[i], self._driven[i] = before, driven
            raise
        driven.driver.__exit__(None, None, None)
        if self.phase == "done":
            self.world.reset()
            self._begin()
            self.phase, self.reason = "lobby", ""
        else:
            self._start_drivers([i])

    def hold_back(self, fairness: Fairness) -> None:
        """Hold all programs back, from the next match on.

        Raises:
            ValueError: during a match.
        """
        if self.phase not in ("lobby", "done"):
            raise ValueError("opponents change between matches")
        self.fairness = fairness
        for i, name in enumerate(self.who):
            if name != PERSON:
                self.seat(i, name)

    def hand(self, i: int, kind: str) -> Driver:
        """What a person steers a seat with: "mouse" or "gamepad"."""
        if self.who[i] == PERSON and self._kinds[i] != kind:
            self._kinds[i], self._hands[i] = kind, make_agent(kind)
            self._driven[i] = self._sit(i)
            self._start_drivers([i])
        return self._hands[i]

    def ego(self, i: int, x: float, y: float) -> tuple[float, float]:
        """A point or a way of the table frame in the frame of a seat."""
        turned = self._turns[i] @ np.array([x, y])
        return float(turned[0]), float(turned[1])

    def _begin(self) -> None:
        """What a new episode needs."""
        self.ticks, self.pauses, self.result, self.events = 0, 0, None, []
        self.number += 1
        self._start_drivers(range(len(self.seats)))
        self.opening = self.state()

    def _start_drivers(self, seats: Iterable[int]) -> None:
        one, world = np.zeros(1, np.int64), self.world
        for i in seats:
            self._driven[i].reset(one, world.seeds, world.episode.number)

    def rehearse(self) -> None:
        """Play half a second for nobody, so that all loops are compiled by then."""
        for _ in range(RATE // 2):
            self._step()
        self.world.reset(int(self.world.seeds[0]))
        self.phase, self.number = "lobby", 0
        self._begin()

    def start(self) -> None:
        """Begin a match, or go on with a paused one."""
        if self.phase == "pause":
            self.phase, self.left = "countdown", max(self.left, RESUME)
        elif self.phase in ("lobby", "done"):
            if self.phase == "done":
                self.world.reset()
                self._begin()
            self.phase, self.left = "countdown", COUNTDOWN
        self.reason = ""

    def pause(self, reason: str = "") -> None:
        """Hold a running match."""
        if self.phase in ("play", "countdown"):
            self.phase, self.reason = "pause", reason
            self.pauses += 1

    def end(self, reason: str) -> None:
        """Break a match off: nobody has won."""
        if self.phase in ("play", "countdown", "pause"):
            self.phase, self.reason = "done", reason

    def tick(self) -> bool:
        """Let a sixtieth of a second pass; whether the world moved."""
        self.events = []
        if self.phase == "countdown":
            self.left -= 1 / RATE
            if self.left <= 1e-9:
                self.phase, self.left = "play", 0.0
        if self.phase != "play":
            return False
        self._step()
        return True

    def _ask(self, i: int) -> Array:
        """What the driver of a seat wants now, (1, 2)."""
        world = self.world
        return self._driven[i].act(
            world.sensed, world.memory, world.episode.physics, world.episode.cycles
        )

    def _step(self) -> None:
        world = self.world
        actions = np.zeros((1, len(self.seats), 2))
        for i in range(len(self.seats)):
            actions[:, i] = self._ask(i)
        self.result = world.step(actions)
        self.ticks += 1
        state = world.state
        for puck, goal_line in np.argwhere(state.crossed[0]).tolist():
            self.events.append(["goal", goal_line, puck])
        for paddle, puck in np.argwhere(state.touched[0] > 0).tolist():
            self.events.append(["hit", paddle, puck])
        if self.result.terminated[0] or self.result.truncated[0]:
            self.phase, self.reason = "done", ""

    def close(self) -> None:
        """Leave the drivers and close the physics."""
        for seat in self._driven:
            seat.driver.__exit__(None, None, None)
        self.world.close()

    @property
    def winners(self) -> list[int]:
        """Seats that have done what the scenario calls success."""
        return np.flatnonzero(self.world.episode.success[0]).tolist()

    def state(self) -> dict[str, Any]:
        """What a page draws, JSON; metres in the table frame."""
        world, state = self.world, self.world.state.map(lambda x: x[0])
        memory = {name: value[0] for name, value in world.memory.items()}
        retired = world.scenario.retired(memory)
        return {
            "phase": self.phase,
            "n": self.ticks,
            "time": round(float(state.time), 3),
            "left": round(self.left, 2),
            "pads": _rounded(state.paddle),
            "pucks": _rounded(np.hstack([state.puck, state.puck_velocity])),
            "blocks": _rounded(state.position[state.bodies.block]),
            "angles": _rounded(state.angle[state.bodies.block]),
            "marks": [
                [m.kind, *_rounded(np.array([*m.start, *m.end, m.radius]))]
                for m in world.scenario.marks(state, memory)
            ],
            "caption": world.scenario.caption(memory),
            "score": _rounded(world.episode.returns[0]),
            "success": self.winners,
            "retired": [] if retired is None else np.flatnonzero(retired).tolist(),
            "reason": self.reason,
            "events": self.events,
        }

    def describe(self) -> dict[str, Any]:
        """What stays as it is: the table, its seats and what may be chosen, JSON."""
        table, scene = self.scene.table, self.scene
        sides = [seat.side for seat in scene.seats]
        radius = scene.bodies.radius
        mouse: Any = make_agent("mouse")
        return {
            "scenario": self.world.scenario.name,
            "seconds": self.world.max_cycles / RATE,
            "table": _rounded(np.asarray(table.vertices)),
            "normals": _rounded(table.normals),
            "paddle": table.paddle_radius,
            "puck": table.puck_radius,
            "blocks": _rounded(np.asarray(radius[scene.bodies.block])),
            "block_shape": scene.block_shape,
            "obstacles": [
                [*o.start, *(o.end or o.start), o.radius] for o in scene.obstacles
            ],
            "goal_lines": [
                {
                    "side": goal_line.side,
                    "owner": sides.index(goal_line.side)
                    if goal_line.side in sides
                    else -1,
                    "ends": _rounded(scene.opening(goal_line)),
                }
                for goal_line in scene.goal_lines
                if goal_line.width is not None
            ],
            "seats": [
                {
                    "side": seat.side,
                    "team": seat.team,
                    "turn": _rounded(self._turns[i]),
                    "reach": _rounded(np.asarray(seat.reach)),
                    "speed": seat.speed,
                    "acceleration": seat.acceleration,
                }
                for i, seat in enumerate(scene.seats)
            ],
            "mouse": {"gain": mouse.gain, "brake": mouse.brake},
            "what": what(self.world.scenario),
        }


def _rounded(values: Array) -> Any:
    return np.round(values, 4).tolist()
