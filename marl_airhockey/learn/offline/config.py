"""Configuration of offline reinforcement learning from recordings."""

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
from marl_airhockey.sim.contracts.image_form import shows_images
from marl_airhockey.sim.core.errors import unknown_name

STEPS = {"bc": 20_000, "iql": 40_000, "td3_bc": 40_000, "rebrac": 40_000}
"""Default number of gradient steps of each algorithm."""
PIXEL_STEPS = 8_000
"""Default number of gradient steps of cloning from pixels."""
MOST_SHIFT = 16
"""Largest allowed shift of images, pixels."""
ALGORITHMS = tuple(STEPS)
"""Names of the algorithms, which are also the names of their files."""


@dataclass(frozen=True, kw_only=True)
class OfflineConfig(RunConfig):
    """Settings of a run that learns from recordings.

    Raises:
        ValueError: A setting is invalid. The message names it.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        *("seed", "seat", "alpha", "critic_penalty", "target_noise", "shift"),
    )
    """Names of the number settings that may be 0."""

    algo: str
    """Name of the algorithm: "bc", "iql", "td3_bc" or "rebrac"."""
    data: list[str]
    """Paths of the recordings, at least one."""
    seat: int = 0
    """Index of the seat whose actions are learned, 0 or more."""
    share: float = 1.0
    """Share of the episodes that are used, above 0 and at most 1. Episodes with the
    highest returns are chosen."""
    total_steps: int
    """Number of gradient steps, above 0."""
    batch_size: int = 256
    """Number of steps in a minibatch, above 0."""
    learning_rate: float = 3e-4
    """Initial learning rate, above 0. It falls to 0 along half a cosine."""
    gamma: float = 0.99
    """Discount per control step, above 0 and at most 1."""
    hidden: list[int]
    """Widths of the hidden layers, each above 0."""
    network: str = "small"
    """Convolutional layers before ``hidden``, if images are observed: "small" or
    "resnet18", see `image_networks.NETWORKS`."""
    shift: int = 0
    """Largest random shift of images in training, pixels, 0 to `MOST_SHIFT`."""
    evaluations: int = 5
    """Number of evaluations during training, above 0."""
    eval_episodes: int = 200
    """Number of episodes of each evaluation, above 0."""
    expectile: float = 0.7
    """IQL: expectile of the action values that defines the value of a state, above 0
    and at most 1."""
    temperature: float = 3.0
    """IQL: factor of the advantage in the exponent of an action's weight, above 0."""
    tau: float = 0.005
    """Share by which target networks move toward their networks in a step, above 0 and
    at most 1."""
    alpha: float = 0.2
    """TD3+BC: weight of the value against cloning, 0 or more. The value of the authors
    is 2.5. In tasks that need precise actions, such as reach, it moves the actor away
    from the data."""
    actor_penalty: float = 2.0
    """ReBRAC: weight of the squared distance between actions and the data in the loss
    of the actor, above 0."""
    critic_penalty: float = 0.01
    """ReBRAC: weight of this squared distance in the target of the critics, 0 or
    more."""
    policy_delay: int = 2
    """TD3+BC and ReBRAC: number of critic steps per actor step, above 0."""
    target_noise: float = 0.2
    """TD3+BC and ReBRAC: standard deviation of the noise of target actions, 0 or
    more."""
    noise_clip: float = 0.5
    """TD3+BC and ReBRAC: largest magnitude of this noise, above 0."""

    def rate(self, step: int) -> float:
        """Return the learning rate of a step, which falls to 0 along half a cosine."""
        share = 0.5 * (1.0 + math.cos(math.pi * step / self.total_steps))
        return self.learning_rate * share

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.algo not in ALGORITHMS:
            raise ValueError(unknown_name("algo", self.algo, ALGORITHMS))
        if not 0 <= self.shift <= MOST_SHIFT:
            raise ValueError(f"shift: {self.shift} must be in 0 .. {MOST_SHIFT}")
        if not shows_images(self.observe) and (self.network != "small" or self.shift):
            raise ValueError(
                "network, shift: they belong to images; set observe=pixels, too"
            )
        if not self.data:
            raise ValueError(f"data: {self.algo} needs at least one recording")
        for name in ("share", "expectile", "tau"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"{name}: {getattr(self, name)} must be in 0 .. 1")


def offline_config(
    algo: str, data: Sequence[str | Path], changes: Mapping[str, Any]
) -> OfflineConfig:
    """Return the configuration of a run on some recordings.

    Scenario, options, observation type, profile and the drivers of other seats are
    those of the recordings. ``changes`` may contain another profile for the
    evaluations.

    Args:
        algo: Name of the algorithm.
        data: Files, folders and names of datasets. A dataset that does not exist is
            built.
        changes: Changed settings, by name.

    Raises:
        ValueError: There are no recordings, they do not fit together, or a setting is
            invalid.
    """
    if algo not in ALGORITHMS:
        raise ValueError(unknown_name("algo", algo, ALGORITHMS))
    check_names(OfflineConfig, changes)
    files = whole_recordings_in([built(path) for path in data])
    head = shared_head(files)
    goals = {"goals": head["goals"]} if "goals" in head else {}
    pixels = shows_images(changes.get("observe", head["observe"]))
    if pixels:
        _check_pixels(algo, head)
    for name in ("scenario", "options", "observe", "control_dt"):
        shown = pixels and name == "observe"  # Pixels are rendered from the states.
        if name in changes and changes[name] != head[name] and not shown:
            raise ValueError(
                f"{name}: {changes[name]!r}, but the recordings are of {head[name]!r} "
                f"({shown_name(files[0])}); give other recordings or omit it"
            )
    seat, players = changes.get("seat", 0), head["players"]
    if seat not in range(len(players)):
        raise ValueError(f"seat: {seat!r} does not exist in {files[0]}")
    # Evaluated policies have paddle_0, so the driver of paddle_0 takes their seat.
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
    """Check that images are cloned, and that the recordings have flat goals.

    Raises:
        ValueError: The algorithm is not bc, or the recordings have separate goals.
    """
    if algo != "bc":
        raise ValueError(f'observe: "pixels" are learned by bc alone, not {algo}')
    if "goals" in head:
        raise ValueError(
            'observe: "pixels" need recordings with goals="flat", which show the goal'
        )
