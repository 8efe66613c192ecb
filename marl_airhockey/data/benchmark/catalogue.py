"""Catalogue of the named datasets and of the drivers in them.

A name is ``airhockey/SCENARIO/TIER-vN``. Each part of a dataset is a recording of one
driver. A dataset has 100,000 steps or a few more, because its episodes are complete.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

from marl_airhockey.data.benchmark.synthetic import SyntheticHuman
from marl_airhockey.data.files import PREFIX
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver

VERSION = 0
"""Version of all datasets; it is increased when drivers, tasks or physics change."""
PROFILE = "ideal"
"""Profile of all datasets."""
STEPS = 100_000
"""Least number of control steps of a dataset."""
TASKS = (
    *("reach", "reach_velocity", "touch", "strike", "strike_crowd", "juggle"),
    *("puck_velocity", "move_block", "hit_goal", "hit_goal_velocity"),
)
"""Scenarios of the ten tasks."""
SNAPSHOTS = ("early", "middle", "medium")
"""Policies of a training run that was stopped at half of the expert's success."""
POLICIES = Path(__file__).parent / "policies"
"""Folder of these policies."""


@dataclass(frozen=True)
class Part:
    """Recording in a dataset, with the steps of one driver."""

    player: str
    """Name of the driver in the recording, and name of the folder."""
    make: Callable[[], Driver]
    """Function that creates the driver of ``paddle_0``."""
    share: float
    """Share of the steps of the dataset."""
    others: Mapping[str, str] = field(default_factory=dict)
    """Drivers of the other seats, by agent."""


@dataclass(frozen=True)
class NamedDataset:
    """Named dataset."""

    scenario: str
    tier: str
    parts: tuple[Part, ...]
    what: str
    """Description of the tier."""

    @property
    def name(self) -> str:
        """Full name, with prefix and version."""
        return f"{PREFIX}/{self.scenario}/{self.tier}-v{VERSION}"

    def seed(self, part: Part) -> int:
        """Return the seed of the first episode of a part."""
        # These seeds differ from those of tests, evaluations and other parts.
        return zlib.crc32(f"{self.name}/{part.player}".encode()) * 1000


def snapshot(task: str, level: str) -> Path:
    """Return the file of a policy from the middle of a training run."""
    return POLICIES / f"{task}-{level}.npz"


def _random(share: float) -> Part:
    return Part("random", lambda: make_driver("random"), share)


def _expert(task: str, share: float) -> Part:
    return Part("expert", lambda: make_driver(f"zoo/{task}"), share)


def _unfinished(task: str, level: str, share: float) -> Part:
    # Actions are sampled, as in training.
    path = snapshot(task, level)
    return Part(level, lambda: load_policy(path, deterministic=False), share)


def _synthetic(policy: str, share: float) -> Part:
    return Part("synthetic-human", lambda: SyntheticHuman(make_driver(policy)), share)


TIERS: dict[str, tuple[str, Callable[[str], tuple[Part, ...]]]] = {
    "random": (
        "actions that are sampled uniformly from the action space",
        lambda task: (_random(1.0),),
    ),
    "medium": (
        "a PPO policy with about half of the expert's success, with sampled actions",
        lambda task: (_unfinished(task, "medium", 1.0),),
    ),
    "medium-replay": (
        "policies from the start to the end of that training, with sampled actions",
        lambda task: (
            _random(0.25),
            *(_unfinished(task, level, 0.25) for level in SNAPSHOTS),
        ),
    ),
    "medium-expert": (
        "half of the steps are from the medium policy, half from the expert",
        lambda task: (_unfinished(task, "medium", 0.5), _expert(task, 0.5)),
    ),
    "expert": (
        "the trained policy of the zoo, with mean actions",
        lambda task: (_expert(task, 1.0),),
    ),
    "synthetic-human": (
        "the expert with latency, noise and errors; a script, not a model of a person",
        lambda task: (_synthetic(f"zoo/{task}", 1.0),),
    ),
}
"""Description and parts of each tier of a task, by name."""


def _play() -> tuple[Part, ...]:
    """Return the parts of the dataset of duels, with different pairs of drivers."""
    players = {
        "zoo-duel": (
            lambda: make_driver("zoo/duel", deterministic=False),
            "zoo/duel_1",
        ),
        "synthetic-human": (
            lambda: SyntheticHuman(make_driver("zoo/duel")),
            "allround",
        ),
        "allround": (lambda: make_driver("allround"), "zoo/duel_2"),
        "striker": (lambda: make_driver("striker"), "goalkeeper"),
        "random": (lambda: make_driver("random"), "striker"),
    }
    return tuple(
        Part(name, make, 1 / len(players), {"paddle_1": other})
        for name, (make, other) in players.items()
    )


def datasets() -> dict[str, NamedDataset]:
    """Return all datasets by name."""
    found = [
        NamedDataset(task, tier, parts(task), what)
        for task in TASKS
        for tier, (what, parts) in TIERS.items()
    ]
    found.append(NamedDataset("duel", "play", _play(), "games of different drivers"))
    return {dataset.name: dataset for dataset in found}


def find_dataset(name: str) -> NamedDataset:
    """Return a dataset by its name.

    Raises:
        ValueError: No dataset has this name.
    """
    known = datasets()
    if name not in known:
        near = ", ".join(get_close_matches(name, known, 3, 0.0))
        raise ValueError(
            f"unknown dataset {name!r}; similar names are {near}; airhockey data list "
            "prints all names"
        )
    return known[name]
