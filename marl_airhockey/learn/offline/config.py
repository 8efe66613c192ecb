"""Configurations of learning from recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from marl_airhockey.data.benchmark.build import built
from marl_airhockey.data.files import (
    shared_head,
    shown_name,
    whole_recordings_in,
)
from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.learn.settings import check_names
from marl_airhockey.sim.core.errors import unknown_name

STEPS = {"bc": 20_000, "iql": 40_000, "td3_bc": 40_000, "rebrac": 40_000}
"""Gradient steps of each algorithm, unless others are given"""
PIXEL_STEPS = 8_000
"""The same of cloning from pixels"""
ALGORITHMS = tuple(STEPS)
"""Names of the algorithms, which are those of their files"""


@dataclass(frozen=True, kw_only=True)
class OfflineConfig(RunConfig):
    """Settings of a run that learns from recordings; ``total_steps`` of its gradient.

    Raises:
        ValueError: a value that makes no sense, named.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        *("seed", "seat", "alpha", "critic_penalty", "target_noise"),
    )

    algo: str
    data: list[str]
    """Files of recordings, and folders of them"""
    seat: int = 0
    """Seat whose play is learned from"""
    share: float = 1.0
    """Share of the episodes that are used, those of the highest returns"""
    total_steps: int
    batch_size: int = 256
    learning_rate: float = 3e-4
    gamma: float = 0.99
    hidden: list[int]
    evaluations: int = 5
    eval_episodes: int = 200
    expectile: float = 0.7
    """Of IQL: the expectile of the values of actions that a state's value is"""
    temperature: float = 3.0
    """Of IQL: how much better actions count more, per unit of advantage"""
    tau: float = 0.005
    """Fraction by which targets move toward their networks in a step"""
    alpha: float = 0.2
    """Of TD3+BC: weight of the value against that of cloning. The authors have 2.5; in
    tasks that need precise actions, as reach, it leads the actor away from the data"""
    actor_penalty: float = 2.0
    """Of ReBRAC: weight of the squared distance of actions from those of the data"""
    critic_penalty: float = 0.01
    """Of ReBRAC: the same in the target of the critics"""
    policy_delay: int = 2
    """Of TD3+BC and ReBRAC: steps of the critics for each of the actor"""
    target_noise: float = 0.2
    """Of TD3+BC and ReBRAC: standard deviation of the noise of target actions"""
    noise_clip: float = 0.5
    """Of TD3+BC and ReBRAC: largest magnitude of that noise"""

    def rate(self, step: int) -> float:
        """Return the learning rate of a step: half a cosine, to nothing at the end."""
        share = 0.5 * (1.0 + math.cos(math.pi * step / self.total_steps))
        return self.learning_rate * share

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.algo not in ALGORITHMS:
            raise ValueError(unknown_name("algo", self.algo, ALGORITHMS))
        if not self.data:
            raise ValueError(f"data: {self.algo} learns from recordings; name some")
        for name in ("share", "expectile", "tau"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"{name}: {getattr(self, name)} must be in 0 .. 1")


def offline_config(
    algo: str, data: Sequence[str | Path], changes: Mapping[str, Any]
) -> OfflineConfig:
    """Return the configuration of a run on some recordings.

    Scenario, options, observation and the drivers of other seats are those of the
    recordings; evaluations are in their profile unless ``changes`` has another.

    Args:
        algo: name of the algorithm.
        data: Files, folders and names of datasets, which are built if they are not.
        changes: settings by name.

    Raises:
        ValueError: no recordings, some that do not fit together, or a bad setting.
    """
    if algo not in ALGORITHMS:
        raise ValueError(unknown_name("algo", algo, ALGORITHMS))
    check_names(OfflineConfig, changes)
    files = whole_recordings_in([built(path) for path in data])
    head = shared_head(files)
    goals = {"goals": head["goals"]} if "goals" in head else {}
    pixels = changes.get("observe", head["observe"]) == "pixels"
    if pixels:
        _check_pixels(algo, head)
    for name in ("scenario", "options", "observe", "control_dt"):
        shown = pixels and name == "observe"  # Rendered from the recorded states.
        if name in changes and changes[name] != head[name] and not shown:
            raise ValueError(
                f"{name}: {changes[name]!r}, but the recordings are of {head[name]!r} "
                f"({shown_name(files[0])}); name others, or leave it out"
            )
    seat, players = changes.get("seat", 0), head["players"]
    if seat not in range(len(players)):
        raise ValueError(f"seat: there is no seat {seat!r} in {files[0]}")
    # Evaluated policies play paddle_0, so who played there takes the learned seat.
    drivers = {
        f"paddle_{i}": players[0 if i == seat else i]["driver"]
        for i in range(1, len(players))
    }
    settings = {
        "scenario": head["scenario"],
        "options": {**head["options"], **goals},
        "observe": head["observe"],
        "control_dt": head["control_dt"],
        "profile": head["profile"],
        "drivers": drivers,
        "total_steps": STEPS[algo] if not pixels else PIXEL_STEPS,
        "batch_size": 256 if not pixels else 64,
        "hidden": [256, 256],
        **changes,
    }
    return OfflineConfig(
        algo=algo, data=[str(path.resolve()) for path in files], **settings
    )


def _check_pixels(algo: str, head: Mapping[str, Any]) -> None:
    """Refuse to learn from pixels what cannot be rendered or is not cloned."""
    if algo != "bc":
        raise ValueError(f'observe: from "pixels" learns bc alone, not {algo}')
    if head["profile"] != "ideal" or "goals" in head:
        raise ValueError(
            'observe: "pixels" are rendered from states, as the profile '
            "ideal with flat goals shows them; the recordings are of others"
        )
