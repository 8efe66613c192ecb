"""Round-robin league of players of a game of two teams."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

import numpy as np

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.evaluation.games import GameResults, play_games
from marl_airhockey.evaluation.standings import Standings
from marl_airhockey.evaluation.stats import elo
from marl_airhockey.toolkit.policies import policies_of
from marl_airhockey.types import Array
from marl_airhockey.world.build import Keywords

LEAGUE_SEED = 3_000_000
"""Seed of a league's first game"""
BATCH = 4096
"""Most games in one batch"""


def play_league(
    scenario: str,
    players: Mapping[str, Driver],
    games: int = 100,
    seed: int = LEAGUE_SEED,
    keywords: Keywords | None = None,
) -> Standings:
    """Let every player play every other.

    Args:
        scenario: name of a game of two teams.
        players: drivers by name, two at least.
        games: number of games of each pair; they change ends at half of them.
        seed: seed of the first game.
        keywords: keywords of the environment.

    Raises:
        ValueError: a single player, or a scenario that is no game of two teams.
    """
    names, count = tuple(players), len(players)
    if count < 2:
        raise ValueError("a league needs at least two players, of different names")
    if games < 2 or games % 2:
        raise ValueError(
            f"games: {games} must be an even number above 0, as ends change at half"
        )
    pairs = np.array(list(combinations(range(count), 2)))
    lineups = pairs.repeat(games, axis=0)
    swapped = np.arange(len(lineups)) % games >= games // 2
    lineups[swapped] = lineups[swapped, ::-1]
    parts = [
        play_games(scenario, list(players.values()), some, seed + first, keywords)
        for first in range(0, len(lineups), BATCH)
        for some in [lineups[first : first + BATCH]]
    ]
    results = GameResults(
        *[np.concatenate(x) for x in zip(*map(_arrays, parts), strict=True)]
    )
    # Columns in the order of `pairs`, whatever the ends.
    won, margin = results.won, results.margin
    won[swapped], margin[swapped] = won[swapped, ::-1], margin[swapped, ::-1]
    won = won.reshape(len(pairs), games, 2)
    wins, draws, goals = np.zeros((3, count, count))
    a, b = pairs.T
    wins[a, b], wins[b, a] = won.sum(1).T
    draws[a, b] = draws[b, a] = (~won.any(-1)).sum(1)
    goals[a, b], goals[b, a] = margin.reshape(len(pairs), games, 2).mean(1).T
    low, ratings, high = _ratings(wins, draws, pairs, seed)
    spread = np.stack([low, high], -1)
    return Standings(scenario, names, games, wins, draws, goals, ratings, spread)


def find_policies(folder: Path) -> list[Path]:
    """Return paths of the policies in a folder: runs of `train`, .npz and .onnx files.

    Raises:
        ValueError: a folder without policies.
    """
    runs = [path.parent for path in sorted(folder.rglob("config.toml"))]
    inside = {run for run in runs if any(map(Path.exists, policies_of(run)))}
    files = [
        path
        for kind in ("npz", "onnx")
        for path in sorted(folder.rglob(f"*.{kind}"))
        if not inside & set(path.parents)
    ]
    found = [*sorted(inside), *files]
    if not found:
        raise ValueError(f"{folder}: no policies and no runs in it")
    return found


def _arrays(results: GameResults) -> tuple[Array, Array, Array]:
    return results.won, results.margin, results.seconds


def _ratings(wins: Array, draws: Array, pairs: Array, seed: int) -> Array:
    """Return (3, E) lower ends, medians and upper ends of ratings, 95 % between ends.

    Ratings are drawn from what the shares of won, drawn and lost games of each pair may
    be (Dirichlet, Jeffreys' prior), so that 100 wins of 100 leave a doubt, too.
    """
    rng, found, (a, b) = np.random.default_rng(seed), [], pairs.T
    counts = np.stack([wins[a, b], draws[a, b], wins[b, a]], -1)
    played = wins + wins.T + draws
    for _ in range(200):
        shares = rng.standard_gamma(counts + 0.5)
        shares /= shares.sum(-1, keepdims=True)
        score = np.zeros(wins.shape)
        score[a, b] = (shares[:, 0] + 0.5 * shares[:, 1]) * played[a, b]
        score[b, a] = played[a, b] - score[a, b]
        found.append(elo(score, played))
    return np.quantile(found, [0.025, 0.5, 0.975], axis=0)
