"""Settings of the worlds of training, and of self-play in them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.registry import find_scenario
from marl_airhockey.sim.world.keywords import Keywords

OPPONENTS = ("random", "goalkeeper", "striker", "allround", "allround:strength=fair")
EVAL_OPPONENTS = ("random", "goalkeeper", "striker", "allround")


@dataclass(frozen=True, kw_only=True)
class SelfPlayConfig(RunConfig):
    """Settings of a run in many worlds, where a game is learned by self-play.

    Raises:
        ValueError: A value that makes no sense, named.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        *RunConfig.MAY_BE_ZERO,
        "action_rate_weight",
        "action_jerk_weight",
        "cost_weight",
        "self_play_fraction",
        "scripted_fraction",
    )
    SELF_PLAY: ClassVar[tuple[str, ...]] = (
        "self_play_fraction",
        "opponents",
        "scripted_fraction",
        "snapshots",
        "pool",
        "opponent_sampling_exponent",
        "opponent_speed_range",
        "eval_opponents",
    )
    """Names of the settings of games alone"""

    training_options: dict[str, Any] = field(default_factory=dict)
    """Values of the scenario's fields in training alone; `options` override them"""
    training_physics: dict[str, Any] = field(default_factory=dict)
    """Physical parameters in training alone; `physics` override them"""
    num_worlds: int
    """Number of worlds of training"""
    action_rate_weight: float = 0.0
    """Weight of the squared change of the action, subtracted from training rewards"""
    action_jerk_weight: float = 0.0
    """Weight of the squared second difference of the action, likewise"""
    cost_weight: float = 0.0
    """Weight of ``cost``, the sum of exceeded limits, likewise"""
    self_play_fraction: float = 0.5
    """Share of the worlds of a game in which the learner plays all seats"""
    opponents: list[str] = field(default_factory=lambda: list(OPPONENTS))
    """Drivers that the learner plays against in games"""
    scripted_fraction: float = 0.5
    """Share of the other worlds' games that are against `opponents`"""
    snapshots: int = 40
    """Number of times that the learner is added to the pool of opponents"""
    pool: int = 16
    """Most snapshots in the pool"""
    opponent_sampling_exponent: float = 2.0
    """Exponent of an opponent's share of won games, by which it is sampled"""
    opponent_speed_range: list[float] = field(default_factory=lambda: [0.1, 1.0])
    """Range of the share of their commanded speed at which opponents move in half of
    the games, so that the learner sometimes scores against good ones"""
    eval_opponents: list[str] = field(default_factory=lambda: list(EVAL_OPPONENTS))
    """Drivers that evaluations of games are against"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self._open_teams:
            raise ValueError(
                f"drivers: every seat of {self.scenario!r} has a driver, so that "
                "nothing is learned; leave one out"
            )
        if self.drivers and self.self_play:
            raise ValueError(
                f"drivers: self-play needs all seats of {self.scenario!r} open; to "
                "learn against somebody, fill all seats of the other teams"
            )
        for name in ("self_play_fraction", "scripted_fraction"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: {getattr(self, name)} must be in 0 .. 1")
        speeds = self.opponent_speed_range
        if len(speeds) != 2 or not 0 <= speeds[0] <= speeds[1] <= 1:
            raise ValueError(
                f"opponent_speed_range: {speeds} must be low and high, in 0 .. 1"
            )

    @cached_property
    def self_play(self) -> bool:
        """True if seats of more than one team are open: the learner plays them all."""
        return len(set(self._open_teams)) > 1

    @cached_property
    def _open_teams(self) -> list[int]:
        seats = enumerate(find_scenario(self.scenario, **self.options).scene.seats)
        return [s.team for i, s in seats if f"paddle_{i}" not in self.drivers]

    @property
    def slots(self) -> int:
        """Number of seats that the learner plays, over all worlds."""
        seats, teams = len(self._open_teams), len(set(self._open_teams))
        if teams == 1:
            return self.num_worlds * seats
        alone = round(self.self_play_fraction * self.num_worlds)
        return alone * seats + (self.num_worlds - alone) * (seats // teams)

    @property
    def training_keywords(self) -> Keywords:
        """Keywords of the environments of training."""
        physics = {**self.training_physics, **self.physics}
        options = {**self.training_options, **self.options}
        return {**self.keywords, "physics": physics, "options": options}
