"""Challenge: one fixed protocol by which players of anybody are compared.

The ten tasks in three profiles, whose physics are drawn anew for each episode, and
duels against a fixed field. What is not played counts as 0.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from marl_airhockey.evaluation.challenge_report import ChallengeReport, ChallengeResult
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import play_against
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
"""Opponents of the duels"""
EPISODES, GAMES = 200, 100
"""Episodes of each task in each profile, and games against each opponent"""
SEED = 6_000_000
"""Seed of the first episode and of the first game

Whoever changes anything above raises `challenge_report.PROTOCOL`."""


def find_player(given: str, scenario: str, profile: str) -> str:
    """Return who plays a scenario in a profile; "" for nobody.

    Args:
        given: a driver's name or a policy's path, who plays all that it can; or "zoo",
            or a folder of policies by name, of which ``<scenario>_<profile>`` comes
            before ``<scenario>``: files or run folders.
        scenario: name of the scenario.
        profile: name of the profile.
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
        given: see `find_player`.
        name: name of the card.
        version: of the library.
        episodes: of each task and profile; fewer give no card to compare.
        games: of each duel.
        report: called after each result.

    Raises:
        ValueError: nothing at all could be played.
    """
    results, files = [], {}
    cells = [(t, p, "") for p in PROFILES for t in TASKS]
    cells += [("duel", "ideal", opponent) for opponent in FIELD]
    for scenario, profile, opponent in cells:
        player = find_player(given, scenario, profile)
        result = _play(scenario, profile, opponent, player, episodes, games)
        if result.player and Path(player).is_file():
            digest = hashlib.sha256(Path(player).read_bytes()).hexdigest()
            files[Path(player).name] = digest
        results.append(result)
        report(result)
    if not any(result.player for result in results):
        raise ValueError(f"{given}: it plays none of it; {results[0].note}")
    return ChallengeReport(name, version, episodes, games, files, tuple(results))


def _play(
    scenario: str, profile: str, opponent: str, player: str, episodes: int, games: int
) -> ChallengeResult:
    """Play one task in one profile, or one opponent."""

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
            found, _ = play_against(
                scenario, driver, [make_driver(opponent)], games, SEED
            )
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
