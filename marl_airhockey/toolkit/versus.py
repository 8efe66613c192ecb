"""Base of games of two teams with a goal at each end."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.sim.contracts.observable import Observable
from marl_airhockey.sim.contracts.scenario import Transition
from marl_airhockey.sim.contracts.units import Latency, Metres, Seconds, Weight
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import GoalLine, Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.toolkit import observables, rewards, serves
from marl_airhockey.toolkit.serves import ServingScenario
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Versus(ServingScenario):
    """Game of two teams, each with a goal at its own end.

    A team that scores gets a reward of 1, and the other team -1. The first team that
    has ``goals_to_win`` goals, and more goals than the other team, wins. If goals are
    equal at the time limit, the team with more shots on goal wins, so that attacking is
    worth more than waiting. After a goal the puck is served from the centre to the team
    that conceded it. A team that has the puck within reach for ``possession`` seconds
    loses it to the other team. A puck is re-served if it rests for ``rest`` seconds in
    a corner or out of reach of all paddles, or if both teams have it within reach for
    ``possession`` seconds.
    """

    announced = ("goals", "stopped", "serve")
    seats: str = "arcade"
    seconds: Seconds = 60.0
    reaction: Latency = 0.15
    goals_to_win: int = 7
    """Number of goals that a team needs to win."""
    pucks: int = 1
    """Number of pucks in play."""
    goal_width: Metres = 0.30
    """Width of the goal lines, m."""
    possession: Seconds = 5.0
    """Largest time for which a team may have a puck within reach, s."""
    rest: Seconds = 0.5
    """Largest time for which a puck may rest where none can play it, s."""
    scored_weight: Weight = 1.0
    """Reward of a goal. A conceded goal gives a reward of -1."""
    shot_weight: Weight = 0.0
    """Reward of a stopped shot on goal, and cost for the team that stopped it."""
    jitter_weight: Weight = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        most = serves.most_served(self.scene)
        if self.pucks > most:
            raise ValueError(
                f"pucks: {self.pucks} do not fit side by side; expected at most {most}"
            )

    @property
    @abstractmethod
    def lineup(self) -> tuple[tuple[int, float], ...]:
        """Side, 0 or 2, and y at the start, m, of each seat."""

    @cached_property
    def scene(self) -> Scene:
        seats = [self.seat(side, (2 - side,), side // 2) for side, _ in self.lineup]
        goal_lines = (
            GoalLine("home", 0, self.goal_width),
            GoalLine("far", 2, self.goal_width),
        )
        return Scene(
            self.table_geometry,
            tuple(seats),
            pucks=self.pucks,
            goal_lines=goal_lines,
            physics={"tilt": 0.0},
        )

    @cached_property
    def teams(self) -> Array:
        """Team of each seat (seats,): 0 at home, 1 at the far end."""
        return np.array([seat.team for seat in self.scene.seats])

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = self.scene.still_state(worlds)
        for i, (side, y) in enumerate(self.lineup):
            state.paddle[:, i] = (0.7 * self.table_geometry.offsets[0] * (side - 1), y)
        toward = np.where(rng.uniform(0.0, 1.0) < 0.5, np.pi, 0.0)
        serves.serve_all(rng, self.scene, state, toward, between=np.pi)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds, seats, pucks = len(rng), len(self.lineup), self.pucks
        return {
            **super().initial_memory(state, rng),
            "goals": np.zeros((worlds, 2)),
            "stopped": np.zeros((worlds, 2)),
            "toucher": np.zeros((worlds, pucks)),
            "held": np.zeros((worlds, seats, pucks)),
            "lying": np.zeros((worlds, pucks)),
            "serve": np.zeros((worlds, pucks)),
        }

    def update_memory(self, t: Transition) -> Memory:
        home, far = t.after.crossed[..., 0], t.after.crossed[..., 1]
        held = rewards.held(self.scene, t)
        foul = held >= self.possession - 1e-9
        lying = rewards.stuck(self.scene, t, held)
        scored = 1.0 * far - 1.0 * home
        fouled = 1.0 * foul[..., 0, :] - 1.0 * foul[..., -1, :]
        # A goal has priority over a foul in the same step.
        toward = np.where(scored != 0.0, scored, fouled)
        again = (toward == 0.0) & ((lying >= self.rest - 1e-9) | t.after.lifted)
        # Between two paddles on the middle line both clocks run at the same time.
        again |= foul.all(-2) & (scored == 0.0)
        nearer = np.where(t.after.puck[..., 0] < 0.0, -1.0, 1.0)
        serve = np.where(again, nearer, toward)
        stopped = rewards.saves(self.scene, t, t.memory["toucher"]).sum(-2)
        ours = [stopped[..., self.teams == team].sum(-1) for team in (0, 1)]
        toucher = rewards.last_toucher(t.memory["toucher"], t.after)
        return {
            "goals": t.memory["goals"] + t.after.crossed[..., ::-1].sum(-2),
            "stopped": t.memory["stopped"] + np.stack(ours, -1),
            "toucher": np.where(serve != 0.0, 0.0, toucher),
            "held": np.where((serve != 0.0)[..., None, :], 0.0, held),
            "lying": np.where(serve != 0.0, 0.0, lying),
            "serve": serve,
        }

    @property
    def observation(self) -> tuple[Observable, ...]:
        return (
            observables.OwnPaddle(),
            observables.OtherPaddles(),
            observables.Pucks(),
            observables.OwnToPucks(),
            observables.PossessionTime(self.possession),
        )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        goal: ``scored_weight`` for each goal that the own team scores, -1 for each that
        the other team scores.
        shot: ``shot_weight`` for each shot on goal by the own team that was stopped,
        ``-shot_weight`` for each by the other team; only if ``shot_weight`` is not 0.
        """
        scored = t.new_memory["goals"] - t.memory["goals"]
        goal = self.scored_weight * scored - scored[..., ::-1]
        terms = {"goal": goal[..., self.teams]}
        if self.shot_weight:
            shots = t.new_memory["stopped"] - t.memory["stopped"]
            shot = self.shot_weight * (shots - shots[..., ::-1])
            terms["shot"] = shot[..., self.teams]
        return terms

    def _leads(self, memory: Memory) -> Array:
        """Return True (..., 2) for the team with more goals.

        If goals are equal, the team that made more shots on goal leads. At most one
        team leads.
        """
        goals, stopped = memory["goals"], memory["stopped"]
        level = goals == goals[..., ::-1]
        more = stopped > stopped[..., ::-1]
        return np.asarray((goals > goals[..., ::-1]) | (level & more))

    def terminated(self, t: Transition) -> Array:
        goals = t.new_memory["goals"]
        won = (goals >= self.goals_to_win) & (goals > goals[..., ::-1])
        return np.asarray(won.any(-1))

    def needs_serve(self, t: Transition) -> Array | None:
        return np.asarray((t.new_memory["serve"] != 0.0).any(-1))

    def headings(self, memory: Memory) -> Array:
        toward = memory["serve"]
        heading = np.where(toward > 0.0, 0.0, np.pi)
        return np.where(toward != 0.0, heading, np.nan)

    def scores(self, memory: Memory) -> dict[str, Array]:
        """Return the goals and the stopped shots on goal, by team."""
        return {"goals": memory["goals"], "shots": memory["stopped"]}

    def deciders(self, memory: Memory) -> dict[str, Array]:
        """Return the goals, and the shots on goal for equal goals."""
        rules = {"goals": "goals", "shots on goal": "stopped"}
        counts = {rule: memory[name] for rule, name in rules.items()}
        return {rule: n[..., 0] != n[..., 1] for rule, n in counts.items()}

    def success(self, t: Transition) -> Array:
        """(..., seats) bool: The team leads at the end of the game.

        It has scored more goals, or equally many and made more shots on goal.
        """
        over = self.terminated(t) | t.time_limit_reached
        return np.asarray(
            (over[..., None] & self._leads(t.new_memory))[..., self.teams]
        )
