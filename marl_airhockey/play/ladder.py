"""Ladder of opponents for people, from gentle to the champion.

A level is a driver with a handicap. `scripts/reproduce/page_ladder.py` measures the
levels of duel against a model of a person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from marl_airhockey.play.handicap import Handicap


@dataclass(frozen=True)
class Level:
    """Level of the ladder."""

    name: str
    """Name for players and for the command line."""
    driver: str
    """Name of the driver."""
    handicap: Handicap = field(default_factory=Handicap)


CHAMPION = 0
"""Number of the best policy of a game; the numbers of others are in their names."""
RUNGS = (
    ("gentle", 1, Handicap(reaction=0.05, noise=0.01, pace=0.45)),
    ("level 1", 1, Handicap(reaction=0.05, noise=0.005, pace=0.6)),
    ("champion at human speed", CHAMPION, Handicap(0.05, noise=0.012, pace=0.55)),
    ("level 2", 3, Handicap(reaction=0.05)),
    ("level 3", 4, Handicap(reaction=0.05)),
    ("champion", CHAMPION, Handicap()),
)
"""Name, number of the policy of the zoo, and handicap of each level."""
USUAL = "champion at human speed"
"""Default level of opponents of people."""
SCRIPTS = (("gentle", "weak"), ("level 1", "fair"), ("level 2", "strong"))
"""Name and strength of the script allround, for games without a policy."""


def ladder_of(scenario: str, policies: Sequence[str], contest: bool) -> list[Level]:
    """Return the levels of a scenario, the easiest first.

    Args:
        scenario: Name of the scenario.
        policies: Policies of the zoo that fit, the best first.
        contest: True if teams play against each other. Teammates have a single level.
    """
    if not contest:
        return [Level("partner", next(iter(policies), "allround"))]
    if not policies:
        return [Level(name, f"allround:strength={how}") for name, how in SCRIPTS]
    numbered = {number: f"zoo/{scenario}_{number}" for _, number, _ in RUNGS}
    best = policies[0]
    levels: dict[tuple[str, Handicap], Level] = {}
    for name, n, handicap in RUNGS:
        driver = numbered[n] if numbered[n] in policies else best
        levels.setdefault((driver, handicap), Level(name, driver, handicap))
    return list(levels.values())


def usual_level(levels: Sequence[Level]) -> Level:
    """Return the default level of a ladder: `USUAL`, or else the middle one."""
    named = [level for level in levels if level.name == USUAL]
    return named[0] if named else levels[len(levels) // 2]
