"""Challenge: a fixed protocol that makes results of different authors comparable.

It has the ten tasks in three profiles, duels against known opponents, duels against a
population of players of different styles, and suites of set pieces. The physics
parameters of the tasks are sampled for each episode. What was not played has the score
0.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from marl_airhockey.evaluation.challenge_report import ChallengeReport, ChallengeResult
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.evaluation.population import opponents
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.evaluation.suites.pieces import suite_names
from marl_airhockey.evaluation.suites.suite import load_suite
from marl_airhockey.policies.load import ZOO
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver

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
    cells = [("tasks", task, profile) for profile in PROFILES for task in TASKS]
    cells += [("duel", opponent, "ideal") for opponent in FIELD]
    cells += [("population", opponent, "ideal") for opponent in opponents()]
    cells += [("set pieces", suite, "ideal") for suite in suite_names()]
    for part, played, profile in cells:
        player = find_player(given, _scenario_of(part, played), profile)
        count = episodes if part == "tasks" else games
        result = _play(part, played, profile, player, count)
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


def _scenario_of(part: str, name: str) -> str:
    """Return the scenario of a task, a duel or a suite."""
    if part == "set pieces":
        return load_suite(name).pieces.task.game
    return name if part == "tasks" else "duel"


def _play(
    part: str, name: str, profile: str, player: str, count: int
) -> ChallengeResult:
    """Play a task in one profile, a duel against one opponent, or a suite."""
    missing = ChallengeResult(part, name, profile, "", 0.0, 0.0, 0.0)
    if not player:
        return replace(missing, note="no policy of this name")
    try:
        found = PLAY[part](make_driver(player), name, profile, count)
    except ValueError as error:
        return replace(missing, note=str(error))
    return replace(missing, player=Path(player).name, **found)


def _play_task(
    driver: Driver, name: str, profile: str, episodes: int
) -> dict[str, Any]:
    found = evaluate(
        driver, name, episodes=episodes, seed=SEED, exact=True, profile=profile
    )
    low, high = found.success_interval
    return {
        **{"score": found.success, "low": low, "high": high},
        "first_shot": found.first_shot,
        "deployability": found.deployability.grade,
    }


def _play_duel(driver: Driver, name: str, profile: str, games: int) -> dict[str, Any]:
    opponent = make_driver(opponents().get(name, name))
    score, _ = play_against("duel", driver, [opponent], games, SEED)
    low, high = interval(float(score[0]), games)
    return {"score": float(score[0]), "low": low, "high": high}


def _play_suite(driver: Driver, name: str, profile: str, games: int) -> dict[str, Any]:
    suite = load_suite(name)
    found = suite.summarize("", suite.play(driver))
    low, high = found.success_interval
    return {"score": found.success, "low": low, "high": high}


PLAY: Mapping[str, Callable[[Driver, str, str, int], dict[str, Any]]] = {
    "tasks": _play_task,
    "duel": _play_duel,
    "population": _play_duel,
    "set pieces": _play_suite,
}
"""Functions that play a part, with driver, name, profile and number of episodes or
games. They return fields of the result."""
