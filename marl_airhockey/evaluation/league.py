"""League of players of a game of two sides or more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations, permutations
from pathlib import Path
from typing import Unpack

import numpy as np

from marl_airhockey.build import scenario_of
from marl_airhockey.evaluation.games import GameResults, play_games, teams_of
from marl_airhockey.evaluation.standings import Standings
from marl_airhockey.evaluation.stats import elo
from marl_airhockey.policies.runs import policies_of
from marl_airhockey.rollouts.as_trained import seated_players
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

LEAGUE_SEED = 3_000_000
"""Seed of a league's first game"""
BATCH = 4096
"""Most games in one batch"""


def league(
    scenario: str,
    players: Mapping[str, object] | Sequence[str],
    *,
    games: int = 100,
    seed: int = LEAGUE_SEED,
    exact: bool = False,
    report: Callable[[float], None] = lambda share: None,
    **keywords: Unpack[Keywords],
) -> Standings:
    """Let every player play every other and rate them.

    What is not given is that of the policies' training, which must agree. In games of
    more than two sides all comparisons of ranks count, as a Plackett-Luce model is
    fitted by all pairs of its rankings (Azari Soufiani and others, 2013).

    Args:
        scenario: Name of a game of two sides or more.
        players: Players by name, see `registry.make_driver`, two at least; or their
            names alone.
        games: Number of games of each pair, on average if there are more than two
            sides; of two, they change ends at half of them.
        seed: Seed of the first game.
        exact: Whether keywords that are not given have their defaults instead.
        report: Function that is called with the share of the games that is played.
        **keywords: Keywords of the environment.

    Raises:
        ValueError: A single player, an odd number of games, or a scenario without
            sides that play against each other.
    """
    drivers, keywords = seated_players(players, scenario, keywords, exact)
    count = len(drivers)
    if count < 2:
        raise ValueError("a league needs at least two players, of different names")
    if games < 2 or games % 2:
        raise ValueError(
            f"games: {games} must be an even number above 0, as ends change at half"
        )
    scene = scenario_of(scenario, keywords).scene
    sides = int(teams_of([seat.team for seat in scene.seats]).max()) + 1
    lineups = lineups_of(count, max(sides, 2), games, seed)
    batches = []
    for first in range(0, len(lineups), BATCH):
        some = lineups[first : first + BATCH]

        def share_of_all(
            share: float, done: int = first, more: int = len(some)
        ) -> None:
            report((done + share * more) / len(lineups))

        those = list(drivers.values()), some, seed + first, keywords
        batches.append(play_games(scenario, *those, share_of_all))
    results = GameResults.joined(batches)
    wins, draws, margin = compared(results, lineups, count)
    low, ratings, high = _ratings(wins, draws, sides - 1, seed)
    spread = np.stack([low, high], -1)
    return Standings(
        scenario, tuple(drivers), games, wins, draws, margin, ratings, spread
    )


def lineups_of(players: int, sides: int, games: int, seed: int) -> Array:
    """Return (G, sides) who plays where, so that each pair meets ``games`` times.

    With two sides each pair does, half of the games at either end. With more, those who
    have met least meet in each game, on average ``games`` times; nobody plays twice in
    a game unless there are fewer players than sides.
    """
    if sides == 2:
        pairs = np.array(list(combinations(range(players), 2))).repeat(games, axis=0)
        swapped = np.arange(len(pairs)) % games >= games // 2
        pairs[swapped] = pairs[swapped, ::-1]
        return pairs
    rng, met = np.random.default_rng(seed), np.zeros((players, players))
    pairs_a_game = min(sides, players) * (min(sides, players) - 1)
    rows = []
    for _ in range(-(-games * players * (players - 1) // pairs_a_game)):
        row: list[int] = []
        while len(row) < sides:
            cost = met[row].sum(0) if row else met.sum(0)
            cost = cost + rng.uniform(0.0, 0.5, players)
            # Those who are in come again when all are.
            cost[row] += 1e9 * np.array([row.count(player) for player in row])
            row.append(int(cost.argmin()))
        for a, b in combinations(sorted(set(row)), 2):
            met[a, b] = met[b, a] = met[a, b] + 1
        rows.append(rng.permutation(row))
    return np.array(rows)


def compared(
    results: GameResults, lineups: Array, players: int
) -> tuple[Array, Array, Array]:
    """Compare all players in all games by their places.

    Args:
        results: of G games.
        lineups: (G, T) who played where.
        players: E.

    Returns:
        (E, E) each: how often the row's player came in ahead of the column's; how often
        neither did; mean margin of the row's in games with the column's.
    """
    wins, draws, margin = np.zeros((3, players, players))
    ahead = results.ahead
    for i, j in permutations(range(lineups.shape[1]), 2):
        apart = lineups[:, i] != lineups[:, j]
        a, b = lineups[apart, i], lineups[apart, j]
        np.add.at(wins, (a, b), ahead[apart, i, j])
        np.add.at(draws, (a, b), ~(ahead[apart, i, j] | ahead[apart, j, i]))
        np.add.at(margin, (a, b), results.margin[apart, i])
    met = wins + wins.T + draws
    return wins, draws, margin / np.maximum(met, 1.0)


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


def _ratings(wins: Array, draws: Array, share: int, seed: int) -> Array:
    """Return (3, E) lower ends, medians and upper ends of ratings, 95 % between ends.

    Ratings are drawn from what the shares of won, drawn and lost games of each pair may
    be (Dirichlet, Jeffreys' prior), so that 100 wins of 100 leave a doubt, too.

    Args:
        wins: (E, E) comparisons.
        draws: (E, E) those without a winner.
        share: comparisons of a player in one game. They share its luck, so that each
            counts as so much less than a game of its own.
        seed: of the draws.
    """
    rng, found = np.random.default_rng(seed), []
    a, b = np.triu_indices(len(wins), 1)
    counts = np.stack([wins[a, b], draws[a, b], wins[b, a]], -1) / share
    played = (wins + wins.T + draws) / share
    for _ in range(200):
        shares = rng.standard_gamma(counts + 0.5)
        shares /= shares.sum(-1, keepdims=True)
        score = np.zeros(wins.shape)
        score[a, b] = (shares[:, 0] + 0.5 * shares[:, 1]) * played[a, b]
        score[b, a] = played[a, b] - score[a, b]
        found.append(elo(score, played))
    return np.quantile(found, [0.025, 0.5, 0.975], axis=0)
