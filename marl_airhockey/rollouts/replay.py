"""Replay of recorded episodes with the rules of a scenario.

The states are those of the recording. Memory, reward terms, ends, sensing and
observations are computed again, by the same code as in a simulation. A recording of one
task can therefore become data of another task with the same bodies. Recorded rewards
can be compared with the current rules.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from marl_airhockey.cameras import camera_models
from marl_airhockey.registry import DEFAULT_BACKEND, find_backend
from marl_airhockey.rollouts.collector import Collector
from marl_airhockey.rollouts.columns import (
    JUDGED,
    PATH,
    STATE,
    scenario_of,
    states_of,
)
from marl_airhockey.sim.contracts.backend import Backend, Command, LiveBackend
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.recording import Episode, Recording
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import RESULTS, State
from marl_airhockey.sim.jit.pipeline import Stage
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array


class ReplayBackend(Backend):
    """Backend that returns recorded states and ignores commands.

    Args:
        scene: Scene of the episodes.
        control_dt: Duration of a step, s.
        states: Evaluated states (T, B, ...) after each step of B episodes.
    """

    timestep: ClassVar[float | None] = None

    def __init__(self, scene: Scene, control_dt: float, states: State) -> None:
        super().__init__(scene, states.time.shape[1], control_dt)
        self._states, self._due = states, 0

    def set_physics(self, values: dict[str, Array], worlds: Array) -> None:
        """Do nothing, because the states are recorded."""

    def stage(self, command: Command, before: State, after: State) -> Stage:
        return Stage(self._fill, (after,))

    def _fill(self, after: State) -> None:
        for name in RESULTS:
            getattr(after, name)[:] = getattr(self._states, name)[self._due]
        if after.path is not None and self._states.path is not None:
            after.path[:] = self._states.path[self._due]
        self._due += 1


class ArmReplayBackend(ReplayBackend):
    """Replay backend for recordings in which arms moved the paddles."""

    instant_contacts: ClassVar[bool] = False
    tracks_commands: ClassVar[bool] = False


class RecordedPhysics(Physics):
    """Physics with the values of recorded episodes.

    Args:
        like: Physics from which the values were sampled.
        values: Values (B,) by name.
    """

    def __init__(self, like: Physics, values: dict[str, Array]) -> None:
        vars(self).update(vars(like))
        self._values = values

    def draw(self, rng: RandomStreams) -> dict[str, Array]:
        """Return the recorded values (B,) by name; all worlds must begin together."""
        return {name: value.copy() for name, value in self._values.items()}


class Replay:
    """Replay of B recorded episodes in parallel.

    With the recorded scenario, memory, rewards and observations are equal to the
    recorded ones. With another scenario, an episode begins with the recorded state, and
    goals are sampled with the recorded seed.

    Args:
        recording: Recording with the episodes, which all have steps.
        scenario: Scenario whose rules are applied; None for the recorded one.
        observe: Observation type; None for the recorded one.

    Raises:
        ValueError: The scene differs from the recorded one, or the recording lacks data
            that the scenario needs. The message names the reason.
    """

    def __init__(
        self,
        recording: Recording,
        scenario: Scenario | None = None,
        observe: str | None = None,
    ) -> None:
        head, episodes = recording.head, recording.episodes
        own = scenario_of(recording)
        self.scenario = game = scenario or own
        self._same = game == own
        _check_scene(game, own)
        states = [states_of(episode, game) for episode in episodes]
        self.lengths = np.array([len(episode) for episode in episodes])
        """Number of steps of each episode (B,)."""
        self._first = _stacked([state.map(lambda x: x[0]) for state in states], 0)
        judged = [
            judged_states(e, s, game) for e, s in zip(episodes, states, strict=True)
        ]
        steps = int(self.lengths.max())
        all_steps = _stacked([_padded(state, steps) for state in judged], 1)
        played = find_backend(head.get("backend", DEFAULT_BACKEND))
        kind = ReplayBackend if played.tracks_commands else ArmReplayBackend
        backend = kind(game.scene, float(head["control_dt"]), all_steps)
        self._actions = np.stack(
            [_padded_rows(e.columns["action"], steps) for e in episodes], 1
        )
        physics = _physics(head, episodes, game, played)
        form = observe or str(head.get("observe", "velocity"))
        cycles = int(head["max_cycles"]) if self._same else None
        cameras = camera_models((form,), game.scene)
        self.world = World(
            *(game, backend, {}, physics, (form,), cycles),
            autoreset=False,
            cameras=cameras,
        )
        """Worlds of the episodes, with all seats open."""
        self._seeds = [episode.seed or 0 for episode in episodes]
        self._numbers = np.array([episode.number for episode in episodes])
        self._reasons = [episode.reason for episode in episodes]

    def begin(self) -> None:
        """Begin all episodes."""
        world = self.world
        world.seed(self._seeds)
        world.begin(None if self._same else self._first, self._numbers)

    def step(self, t: int) -> StepResult:
        """Make step t, from 0. Episodes that have ended stay in their last state."""
        return self.world.step(self._actions[t])

    def episodes(self, names: Collection[str] | None = None) -> Iterator[Episode]:
        """Replay all episodes and yield each, as long as it was recorded.

        Args:
            names: Names of the computed columns, without those that the worlds lack;
                None for all.
        """
        self.begin()
        collector = Collector(self.world, names)
        for t in range(int(self.lengths.max())):
            self.step(t)
            collector.add()
        yield from collector.episodes(self.lengths, self._reasons)


def judged_states(episode: Episode, states: State, scenario: Scenario) -> State:
    """Return the states (T, ...) that the rules evaluated, before serves.

    Args:
        episode: Episode of T steps.
        states: States of the episode (T + 1, ...).
        scenario: Scenario whose rules are applied.

    Raises:
        ValueError: The scenario needs the path of the puck within a step, and the
            recording does not have it.
    """
    after = states.map(lambda x: x[1:])
    names = {name: episode.columns.get(JUDGED + name) for name in RESULTS}
    known = {name: value for name, value in names.items() if value is not None}
    after = replace(after, **known)  # type: ignore[arg-type]
    if not scenario.scene.path:
        return after
    path = episode.columns.get(STATE + PATH)
    if path is None:
        raise ValueError(
            f"{scenario.name} needs the path of the puck within a step, which "
            "recordings of other scenarios do not have"
        )
    return replace(after, path=path)


def _check_scene(game: Scenario, own: Scenario) -> None:
    """Check that a scenario has the scene of the recorded scenario."""
    new, old = game.scene, own.scene
    for name in ("table", "seats", "goal_lines", "bodies"):
        if getattr(new, name) != getattr(old, name):
            raise ValueError(
                f"{game.name}: its {name.replace('_', ' ')} differ from those of the "
                f"recorded scenario {own.name}"
            )


def _physics(
    head: dict[str, object],
    episodes: Sequence[Episode],
    game: Scenario,
    played: type[Backend],
) -> Physics:
    """Return the physics of episodes, and the ranges from which they were sampled.

    For a real table nothing is simulated, because its states are measured.
    """
    profile, given = str(head.get("profile", "ideal")), head.get("physics")
    arms, real = not played.tracks_commands, issubclass(played, LiveBackend)
    like = Physics(game.scene.defaults, profile, given, arms=arms, real=real)  # type: ignore[arg-type]
    values = {
        name: np.array([episode.physics[name] for episode in episodes])
        for name in episodes[0].physics
    }
    return RecordedPhysics(like, values)


def _padded_rows(rows: Array, count: int) -> Array:
    """Return rows (T, ...) with the last one repeated up to a count."""
    return np.concatenate([rows, np.repeat(rows[-1:], count - len(rows), 0)])


def _padded(states: State, count: int) -> State:
    """Return states (T, ...) with the last one repeated up to a count."""
    return states.map(lambda x: _padded_rows(x, count))


def _stacked(states: list[State], axis: int) -> State:
    """Return states of B episodes as one, with an axis for them."""
    fields = {
        name: np.stack([getattr(state, name) for state in states], axis)
        for name in (*RESULTS, "visible")
    }
    paths = [state.path for state in states if state.path is not None]
    path = np.stack(paths, axis) if paths else None
    return replace(states[0], path=path, **fields)  # type: ignore[arg-type]
