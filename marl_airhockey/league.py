"""A round-robin of players of a game: ratings, a matrix, and who beats whom in turn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.contest import Outcomes, play
from marl_airhockey.driver import Driver
from marl_airhockey.make import Keywords
from marl_airhockey.state import Array
from marl_airhockey.stats import elo, interval

LEAGUE_SEED = 3_000_000
BATCH = 4096
"""Most games at once."""


@dataclass(frozen=True)
class Standings:
    """Results of E players, each against each."""

    scenario: str
    names: tuple[str, ...]
    games: int
    """Of each pair, half of them at either end."""
    wins: Array
    """(E, E) games that the row's player won against the column's"""
    draws: Array
    """(E, E)"""
    margin: Array
    """(E, E) mean goals for less goals against"""
    ratings: Array
    """(E,) Elo, 1000 on average"""
    rating_intervals: Array
    """(E, 2) 95 %, by resampling games"""

    @property
    def score(self) -> Array:
        """(E, E) share of points, a draw being half a win; nan against oneself."""
        with np.errstate(invalid="ignore"):
            share = (self.wins + 0.5 * self.draws) / self.played
        return np.asarray(share)

    @property
    def played(self) -> Array:
        """(E, E) games."""
        return np.asarray(self.wins + self.wins.T + self.draws)

    @property
    def order(self) -> list[int]:
        """Players, the best first."""
        return [int(i) for i in np.argsort(-self.ratings, kind="stable")]

    @property
    def circles(self) -> list[tuple[str, str, str]]:
        """Triples in which each certainly (95 %) beats the next, the last the first."""
        beats = np.zeros(self.score.shape, np.bool_)
        for a, b in permutations(range(len(self.names)), 2):
            low, _ = interval(float(self.score[a, b]), int(self.played[a, b]))
            beats[a, b] = low > 0.5
        found = []
        for a, b, c in combinations(range(len(self.names)), 3):
            for x, y, z in ((a, b, c), (a, c, b)):
                if beats[x, y] and beats[y, z] and beats[z, x]:
                    found.append((self.names[x], self.names[y], self.names[z]))
        return found

    def rows(self) -> list[dict[str, Any]]:
        """The table, the best first."""
        wins, draws = self.wins.sum(-1), self.draws.sum(-1)
        losses, others = self.wins.sum(0), len(self.names) - 1
        low, high = self.rating_intervals.T
        return [
            {
                "player": self.names[i],
                "elo": float(self.ratings[i]),
                "elo_low": float(low[i]),
                "elo_high": float(high[i]),
                "score": float(np.nanmean(self.score[i])),
                "wins": int(wins[i]),
                "draws": int(draws[i]),
                "losses": int(losses[i]),
                "goal_difference": float(self.margin[i].sum() / others),
            }
            for i in self.order
        ]

    def to_json(self) -> dict[str, Any]:
        """For a report."""
        order = self.order
        return {
            "scenario": self.scenario,
            "games_of_a_pair": self.games,
            "table": self.rows(),
            "players": [self.names[i] for i in order],
            "score": self.score[np.ix_(order, order)].tolist(),
            "goal_difference": self.margin[np.ix_(order, order)].tolist(),
            "circles": self.circles,
        }

    def to_markdown(self) -> str:
        """The table and the circles."""
        lines = [
            f"# League of {self.scenario}: {self.games} games of each pair",
            "",
            "| player | Elo (95 %) | score | won | drawn | lost | goals a game |",
            "| --- | --- | --- | --- | --- | --- | --- |",
        ]
        for r in self.rows():
            lines.append(
                f"| {r['player']} | {r['elo']:.0f} ({r['elo_low']:.0f}.."
                f"{r['elo_high']:.0f}) | {r['score']:.3f} | {r['wins']} | {r['draws']}"
                f" | {r['losses']} | {r['goal_difference']:+.2f} |"
            )
        lines += ["", *(f"Circle: {' > '.join((*c, c[0]))}" for c in self.circles)]
        return "\n".join(lines).rstrip() + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write ``league.json``, ``league.md`` and ``league.png``."""
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"league.{kind}" for kind in ("json", "md", "png")]
        files[0].write_text(json.dumps(self.to_json(), indent=1))
        files[1].write_text(self.to_markdown())
        picture(self, files[2])
        return files


def league(
    scenario: str,
    players: Mapping[str, Driver],
    games: int = 100,
    seed: int = LEAGUE_SEED,
    keywords: Keywords | None = None,
) -> Standings:
    """Let everybody play everybody.

    Args:
        scenario: a game of two teams.
        players: by name, two at least.
        games: of each pair; they change ends at half of them.
        seed: of the first game.
        keywords: of the environment.

    Raises:
        ValueError: a single player, or a scenario that is no game of two teams.
    """
    names, count = tuple(players), len(players)
    if count < 2:
        raise ValueError("a league needs at least two players")
    pairs = np.array(list(combinations(range(count), 2)))
    lineups = pairs.repeat(games, axis=0)
    swapped = np.arange(len(lineups)) % games >= games // 2
    lineups[swapped] = lineups[swapped, ::-1]
    parts = [
        play(scenario, list(players.values()), some, seed + first, keywords)
        for first in range(0, len(lineups), BATCH)
        for some in [lineups[first : first + BATCH]]
    ]
    found = Outcomes(
        *[np.concatenate(x) for x in zip(*map(_fields, parts), strict=True)]
    )
    # Columns as in `pairs`, whatever the ends.
    won, margin = found.won, found.margin
    won[swapped], margin[swapped] = won[swapped, ::-1], margin[swapped, ::-1]
    won = won.reshape(len(pairs), games, 2)
    wins, draws, goals = np.zeros((3, count, count))
    a, b = pairs.T
    wins[a, b], wins[b, a] = won.sum(1).T
    draws[a, b] = draws[b, a] = (~won.any(-1)).sum(1)
    goals[a, b], goals[b, a] = margin.reshape(len(pairs), games, 2).mean(1).T
    ratings = elo(wins + 0.5 * draws, wins + wins.T + draws)
    spread = _rating_intervals(won, pairs, count, seed)
    return Standings(scenario, names, games, wins, draws, goals, ratings, spread)


def found_in(folder: Path) -> list[str]:
    """Paths of the policies in a folder: runs of `train`, frozen and ONNX files.

    Raises:
        ValueError: a folder without any.
    """
    runs = [path.parent for path in sorted(folder.rglob("config.toml"))]
    inside = {run for run in runs if (run / "last.zip").exists()}
    files = [
        path
        for kind in ("npz", "onnx")
        for path in sorted(folder.rglob(f"*.{kind}"))
        if not inside & set(path.parents)
    ]
    found = [str(path) for path in (*sorted(inside), *files)]
    if not found:
        raise ValueError(f"{folder}: no policies and no runs in it")
    return found


def _fields(found: Outcomes) -> tuple[Array, Array, Array]:
    return found.won, found.margin, found.seconds


def _rating_intervals(won: Array, pairs: Array, count: int, seed: int) -> Array:
    """(E, 2) 95 % intervals of ratings, games of each pair being drawn again."""
    rng, games, found = np.random.default_rng(seed), won.shape[1], []
    points = won + 0.5 * ~won.any(-1, keepdims=True)
    a, b = pairs.T
    played = np.zeros((count, count))
    played[a, b] = played[b, a] = games
    for _ in range(200):
        drawn = rng.integers(0, games, (len(pairs), games))
        sums = np.take_along_axis(points, drawn[..., None], axis=1).sum(1)
        score = np.zeros((count, count))
        score[a, b], score[b, a] = sums.T
        found.append(elo(score, played))
    return np.quantile(found, [0.025, 0.975], axis=0).T


def picture(standings: Standings, path: Path) -> None:
    """The matrix of scores, the best player first."""
    import matplotlib.pyplot as plt

    from marl_airhockey.charts import DPI, save

    order, count = standings.order, len(standings.names)
    score = standings.score[np.ix_(order, order)]
    names = [standings.names[i] for i in order]
    size = 2.6 + 0.62 * count
    figure, axes = plt.subplots(
        figsize=(size + 1.2, size), dpi=DPI, layout="constrained"
    )
    image = axes.imshow(score, cmap="RdBu", vmin=0.0, vmax=1.0)
    for row in range(count):
        for column in range(count):
            if row != column:
                value = score[row, column]
                ink = "white" if abs(value - 0.5) > 0.32 else "black"
                text = f"{value:.2f}"
                axes.text(
                    column, row, text, ha="center", va="center", color=ink, size=8
                )
    axes.set_xticks(range(count), names, rotation=45, ha="right")
    axes.set_yticks(range(count), names)
    axes.set_title(f"{standings.scenario}: score of the row against the column")
    axes.spines[:].set_visible(False)
    figure.colorbar(image, ax=axes, shrink=0.7, label="win + draw / 2")
    save(figure, path)
