"""League: games of all players against each other in a game of two or more teams."""

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
"""Seed of the first game of a league."""
BATCH = 4096
"""Largest number of games in one batch."""


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
    """Let every player play against every other one, and compute ratings.

    Keywords that are not given are those of the training of the policies, which must
    agree. In games of more than two teams all comparisons of ranks count: a
    Plackett-Luce model is fitted by all pairs of its rankings (Azari Soufiani and
    others, 2013).

    Args:
        scenario: Name of a game of two or more teams.
        players: Two or more players by name, see `registry.make_driver`; or a sequence
            of names of drivers.
        games: Number of games of each pair, an even number. With two teams, the players
            change ends after half of the games. With more teams, it is the mean number.
        seed: Seed of the first game.
        exact: True to use the defaults for keywords that are not given.
        report: Function that is called with the share of the games that are finished.
        **keywords: Keywords of the environment.

    Raises:
        ValueError: There is only one player, the number of games is odd, or the
            scenario has no teams that play against each other.
    """
    drivers, keywords = seated_players(players, scenario, keywords, exact)
    count = len(drivers)
    if count < 2:
        raise ValueError("a league needs at least two players, of different names")
    if games < 2 or games % 2:
        raise ValueError(
            f"games: {games} must be an even number above 0, because the players "
            "change ends after half of them"
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
    """Return lineups in which each pair of players meets ``games`` times.

    With two teams, each pair plays half of its games at either end. With more teams,
    each game has the players that met least, so that pairs meet ``games`` times on
    average. A player is in a game more than once only if there are fewer players than
    teams.

    Args:
        players: Number of players.
        sides: Number of teams.
        games: Number of games of each pair.
        seed: Seed of the order with more than two teams.

    Returns:
        Index of the player of each team in each game, (G, sides).
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
            # Players are only repeated when every player is in the game.
            cost[row] += 1e9 * np.array([row.count(player) for player in row])
            row.append(int(cost.argmin()))
        for a, b in combinations(sorted(set(row)), 2):
            met[a, b] = met[b, a] = met[a, b] + 1
        rows.append(rng.permutation(row))
    return np.array(rows)


def compared(
    results: GameResults, lineups: Array, players: int
) -> tuple[Array, Array, Array]:
    """Compare all players in all games by their ranks.

    Args:
        results: Results of G games.
        lineups: Index of the player of each team in each game, (G, T).
        players: Number of players, E.

    Returns:
        Three arrays (E, E): number of games in which the player of the row was ahead of
        the player of the column, number of games in which neither was ahead, and mean
        margin of the player of the row in games with the player of the column.
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
    """Return the policies in a folder: runs of `train`, .npz and .onnx files.

    Raises:
        ValueError: The folder has no policies.
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
        raise ValueError(f"{folder}: the folder contains no policies and no runs")
    return found


def _ratings(wins: Array, draws: Array, share: int, seed: int) -> Array:
    """Return the lower end, the median and the upper end of ratings, (3, E).

    The ends are those of a 95 % interval. The shares of won, drawn and lost games of
    each pair are sampled from their posterior distribution (Dirichlet, Jeffreys'
    prior). 100 wins in 100 games therefore do not give a share of exactly 1.

    Args:
        wins: Number of comparisons that the player of the row won, (E, E).
        draws: Number of comparisons without a winner, (E, E).
        share: Number of comparisons of a player in one game. They are not independent,
            so each counts as 1 / share of a game.
        seed: Seed of the samples.
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
