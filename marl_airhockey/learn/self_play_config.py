"""Settings of the training worlds, and of self-play in them."""

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
    """Settings of a run in many worlds, in which games are learned by self-play.

    Raises:
        ValueError: A setting is invalid. The message names it.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        *RunConfig.MAY_BE_ZERO,
        "action_rate_weight",
        "action_jerk_weight",
        "cost_weight",
        "mirrored_share",
        "self_play_fraction",
        "scripted_fraction",
        "exploiters",
    )
    """Names of the number settings that may be 0."""
    SELF_PLAY: ClassVar[tuple[str, ...]] = (
        "self_play_fraction",
        "opponents",
        "scripted_fraction",
        "snapshots",
        "pool",
        "exploiters",
        "exploiter_share",
        "opponent_sampling_exponent",
        "opponent_speed_range",
        "eval_opponents",
    )
    """Names of the settings that only games have."""

    training_options: dict[str, Any] = field(default_factory=dict)
    """Options of the scenario in training only; ``options`` override them."""
    training_physics: dict[str, Any] = field(default_factory=dict)
    """Physics parameters in training only; ``physics`` override them."""
    num_worlds: int
    """Number of parallel worlds, above 0."""
    action_rate_weight: float = 0.0
    """Weight of the squared change of the action, which is subtracted from the rewards
    of the training; 0 for none. Actions are divided by the top speed."""
    action_jerk_weight: float = 0.0
    """Weight of the squared second difference of the action, also subtracted; 0 for
    none."""
    cost_weight: float = 0.0
    """Weight of ``cost``, the sum of exceeded limits, also subtracted; 0 for none."""
    mirrored_share: float = 0.0
    """Share of the episodes in which a player sees and acts as in a mirror at the long
    axis of the table, 0 to 1; 0.5 is other-play, see `mirror.Mirror`."""
    self_play_fraction: float = 0.5
    """Share of the worlds of a game in which the learner plays all seats, 0 to 1."""
    opponents: list[str] = field(default_factory=lambda: list(OPPONENTS))
    """Drivers that the learner plays against in games."""
    scripted_fraction: float = 0.5
    """Share of the games in the other worlds that are against ``opponents``, 0 to 1."""
    snapshots: int = 40
    """Number of times that the learner is added to the pool of opponents, above 0."""
    pool: int = 16
    """Largest number of snapshots in the pool, above 0."""
    exploiters: int = 0
    """Number of exploiters that join the pool. An exploiter starts from the weights of
    the learner and trains against the learner alone. Only with the engine torch."""
    exploiter_share: float = 1 / 3
    """Steps of all exploiters together, divided by ``total_steps``, above 0."""
    opponent_sampling_exponent: float = 2.0
    """Exponent of an opponent's share of won games in its sampling weight, above 0."""
    opponent_speed_range: list[float] = field(default_factory=lambda: [0.1, 1.0])
    """Low and high end, 0 to 1, of the share of the commanded speed at which opponents
    move in half of the games, so that the learner sometimes scores against strong
    opponents."""
    eval_opponents: list[str] = field(default_factory=lambda: list(EVAL_OPPONENTS))
    """Drivers that the learner plays against in evaluations of games."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self._open_teams:
            raise ValueError(
                f"drivers: every seat of {self.scenario!r} has a driver, so nothing is "
                "learned; leave one seat open"
            )
        if self.drivers and self.self_play:
            raise ValueError(
                f"drivers: self-play needs all seats of {self.scenario!r} open; to "
                "learn against a driver, give it all seats of the other teams"
            )
        for name in ("mirrored_share", "self_play_fraction", "scripted_fraction"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: {getattr(self, name)} must be in 0 .. 1")
        speeds = self.opponent_speed_range
        if len(speeds) != 2 or not 0 <= speeds[0] <= speeds[1] <= 1:
            raise ValueError(
                f"opponent_speed_range: {speeds} must be [low, high] in 0 .. 1"
            )

    @cached_property
    def self_play(self) -> bool:
        """True if seats of several teams are open; the learner plays all of them."""
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
        """Keywords of the environments of the training."""
        physics = {**self.training_physics, **self.physics}
        options = {**self.training_options, **self.options}
        return {**self.keywords, "physics": physics, "options": options}
