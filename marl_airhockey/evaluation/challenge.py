"""Challenge: a fixed protocol that makes results of different authors comparable.

It has the ten tasks in three profiles, duels against known opponents, and duels against
a population of players of different styles. The physics parameters of the tasks are
sampled for each episode. A part of the protocol that was not played has the score 0.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from marl_airhockey.evaluation.challenge_report import ChallengeReport, ChallengeResult
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.evaluation.population import opponents
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.policies.load import ZOO
from marl_airhockey.registry import make_driver

TASKS = (
    "reach",
    "reach_velocity",
    "touch",
    "strike",
    "strike_crowd",
    "juggle",
    "puck_velocity",
    "move_block",
    "hit_goal",
    "hit_goal_velocity",
)
PROFILES = ("ideal", "ur5e", "gantry")
FIELD = ("random", "goalkeeper", "striker", "allround", "zoo/duel")
"""Opponents of the duels."""
EPISODES, GAMES = 200, 100
"""Number of episodes of each task in each profile, and of games against each
opponent."""
SEED = 6_000_000
"""Seed of the first episode and of the first game.

If a constant above is changed, `challenge_report.PROTOCOL` has to be increased.
"""


def find_player(given: str, scenario: str, profile: str) -> str:
    """Return the driver that plays a scenario in a profile; "" if there is none.

    Args:
        given: Name of a driver or path of a policy, which then plays everything. Or
            "zoo", or a folder of policies (files or run folders) whose names are
            ``<scenario>_<profile>`` or ``<scenario>``. The first of the two names is
            preferred.
        scenario: Name of the scenario.
        profile: Name of the profile.
    """
    folder = ZOO if given == "zoo" else Path(given)
    if not folder.is_dir() or (folder / "config.toml").exists():
        return given
    for name in (f"{scenario}_{profile}", scenario):
        for kind in (".npz", ".onnx", ".zip", ""):
            path = folder / f"{name}{kind}"
            if path.exists():
                return str(path)
    return ""


def play_challenge(
    given: str,
    name: str,
    version: str,
    episodes: int = EPISODES,
    games: int = GAMES,
    report: Callable[[ChallengeResult], None] = lambda result: None,
) -> ChallengeReport:
    """Play the protocol.

    Args:
        given: Driver, policy or folder of policies, see `find_player`.
        name: Name of the card.
        version: Version of the library.
        episodes: Number of episodes of each task and profile. Cards with fewer episodes
            than the protocol requires are not comparable.
        games: Number of games of each duel.
        report: Function that is called after each result.

    Raises:
        ValueError: No part of the protocol could be played, or a player of the
            population is not the published one.
    """
    results, files = [], {}
    others = {name: name for name in FIELD} | opponents()
    cells = [(t, p, "") for p in PROFILES for t in TASKS]
    cells += [("duel", "ideal", opponent) for opponent in others]
    for scenario, profile, opponent in cells:
        player = find_player(given, scenario, profile)
        other = others.get(opponent, "")
        result = _play(scenario, profile, opponent, other, player, episodes, games)
        if result.player and Path(player).is_file():
            digest = hashlib.sha256(Path(player).read_bytes()).hexdigest()
            files[Path(player).name] = digest
        results.append(result)
        report(result)
    if not any(result.player for result in results):
        raise ValueError(
            f"{given}: plays no part of the challenge; first reason: {results[0].note}"
        )
    return ChallengeReport(name, version, episodes, games, files, tuple(results))


def _play(
    scenario: str,
    profile: str,
    opponent: str,
    other: str,
    player: str,
    episodes: int,
    games: int,
) -> ChallengeResult:
    """Play one task in one profile, or the duel against one opponent, ``other``."""

    def missing(note: str) -> ChallengeResult:
        return ChallengeResult(
            scenario, profile, opponent, "", 0.0, 0.0, 0.0, 0.0, "", note
        )

    if not player:
        return missing("no policy of this name")
    shown = Path(player).name
    try:
        driver = make_driver(player)
        if opponent:
            found, _ = play_against(scenario, driver, [make_driver(other)], games, SEED)
            score = float(found[0])
            ends = interval(score, games)
            return ChallengeResult(
                scenario, profile, opponent, shown, score, *ends, 0.0, "", ""
            )
        task = evaluate(
            driver,
            scenario,
            episodes=episodes,
            seed=SEED,
            name=shown,
            exact=True,
            profile=profile,
        )
    except ValueError as error:
        return missing(str(error))
    success, ends = task.success, task.success_interval
    first, grade = task.first_shot, task.deployability.grade
    return ChallengeResult(
        scenario, profile, "", shown, success, *ends, first, grade, ""
    )
