"""Standings of a league: scores, ratings, table and plot."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.evaluation.stats import (
    interval,
    nash_mixture,
    without_nan,
)
from marl_airhockey.types import Array


@dataclass(frozen=True)
class Standings:
    """Results of E players that played against each other."""

    scenario: str
    names: tuple[str, ...]
    games: int
    """Number of games of each pair; the mean number with more than two teams."""
    wins: Array
    """Number of games in which the player of the row was ahead of that of the column,
    (E, E)."""
    draws: Array
    """Number of games in which neither player was ahead, (E, E)."""
    margin: Array
    """Mean goals for minus goals against of the player of the row, (E, E)."""
    ratings: Array
    """Elo ratings, (E,), 1000 on average: medians of the ratings that fit the games."""
    rating_intervals: Array
    """95 % intervals of the ratings, (E, 2)."""

    @property
    def score(self) -> Array:
        """Share of points, (E, E), where a draw is half a win; nan on the diagonal."""
        with np.errstate(invalid="ignore"):
            share = (self.wins + 0.5 * self.draws) / self.played
        return np.asarray(share)

    @property
    def score_intervals(self) -> Array:
        """95 % intervals of the scores, (E, E, 2); nan on the diagonal."""
        pairs = zip(self.score.flat, self.played.flat, strict=True)
        ends = [
            interval(float(score), int(n)) if n else (np.nan, np.nan)
            for score, n in pairs
        ]
        return np.reshape(ends, (*self.score.shape, 2))

    @property
    def played(self) -> Array:
        """Number of games of each pair, (E, E)."""
        return np.asarray(self.wins + self.wins.T + self.draws)

    @property
    def order(self) -> list[int]:
        """Indices of the players, the best one first."""
        return [int(i) for i in np.argsort(-self.ratings, kind="stable")]

    @property
    def mixture(self) -> Array:
        """Shares of the players in the mixture that no player beats, (E,).

        A player that beats all others has a share of 1. In a cycle all players have a
        share. See `stats.nash_mixture`.
        """
        return nash_mixture(np.nan_to_num(self.score, nan=0.5))

    @property
    def cycles(self) -> list[tuple[str, str, str]]:
        """Triples in which each player beats the next one, and the last one the first.

        A player beats another one if the 95 % interval of its score is above 0.5.
        """
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
        """Return the rows of the table, the best player first."""
        wins, draws = self.wins.sum(-1), self.draws.sum(-1)
        losses, others = self.wins.sum(0), len(self.names) - 1
        low, high = self.rating_intervals.T
        mixture = self.mixture
        against = np.nan_to_num(self.score, nan=0.5) @ mixture
        return [
            {
                "player": self.names[i],
                "elo": float(self.ratings[i]),
                "elo_low": float(low[i]),
                "elo_high": float(high[i]),
                "score": float(np.nanmean(self.score[i])),
                "nash_share": float(mixture[i]),
                "nash_score": float(against[i]),
                "wins": int(wins[i]),
                "draws": int(draws[i]),
                "losses": int(losses[i]),
                "goal_difference": float(self.margin[i].sum() / others),
            }
            for i in self.order
        ]

    def to_json(self) -> dict[str, Any]:
        """Return table, scores and cycles as a JSON object, the best player first."""
        order = self.order
        data = {
            "scenario": self.scenario,
            "games_of_a_pair": self.games,
            "table": self.rows(),
            "players": [self.names[i] for i in order],
            "score": self.score[np.ix_(order, order)].tolist(),
            "score_intervals": self.score_intervals[np.ix_(order, order)].tolist(),
            "goal_difference": self.margin[np.ix_(order, order)].tolist(),
            "cycles": self.cycles,
        }
        found: dict[str, Any] = without_nan(data)
        return found

    def to_markdown(self) -> str:
        """Return the table and the cycles as Markdown."""
        lines = [
            f"# League of {self.scenario}: {self.games} games of each pair",
            "",
            "| player | Elo (95 %) | score | Nash share | score against it | won "
            "| drawn | lost | goals a game |",
            "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        ]
        for r in self.rows():
            lines.append(
                f"| {r['player']} | {r['elo']:.0f} ({r['elo_low']:.0f}.."
                f"{r['elo_high']:.0f}) | {r['score']:.3f} | {r['nash_share']:.2f} | "
                f"{r['nash_score']:.3f} | {r['wins']} | {r['draws']} | {r['losses']} | "
                f"{r['goal_difference']:+.2f} |"
            )
        lines += ["", *(f"Cycle: {' > '.join((*c, c[0]))}" for c in self.cycles)]
        return "\n".join(lines).rstrip() + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write ``league.json``, ``league.md`` and ``league.png``; return the paths."""
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"league.{kind}" for kind in ("json", "md", "png")]
        files[0].write_text(json.dumps(self.to_json(), indent=1))
        files[1].write_text(self.to_markdown())
        plot_scores(self, files[2])
        return files


def plot_scores(standings: Standings, path: Path) -> None:
    """Plot the matrix of scores with their 95 % intervals, the best player first."""
    from marl_airhockey.sim.render.charts import panels, save

    order, count = standings.order, len(standings.names)
    score = standings.score[np.ix_(order, order)]
    ends = standings.score_intervals[np.ix_(order, order)]
    low, high = standings.rating_intervals.T
    names = [
        f"{standings.names[i]}\nElo {standings.ratings[i]:.0f} "
        f"({low[i]:.0f}..{high[i]:.0f})"
        for i in order
    ]
    size = 2.6 + 0.8 * count
    figure, grid = panels(size=(size + 1.2, size))
    axes = grid[0, 0]
    axes.grid(visible=False)
    image = axes.imshow(score, cmap="RdBu", vmin=0.0, vmax=1.0)
    for row, column in permutations(range(count), 2):
        value = score[row, column]
        ink = "white" if abs(value - 0.5) > 0.32 else "black"
        style = {"ha": "center", "color": ink}
        least, most = ends[row, column]
        axes.text(column, row, f"{value:.2f}", va="bottom", size=10, **style)
        axes.text(column, row, f"{least:.2f}..{most:.2f}", va="top", size=7, **style)
    axes.set_xticks(range(count), [standings.names[i] for i in order], rotation=45)
    for label in axes.get_xticklabels():
        label.set(ha="right", rotation_mode="anchor")
    axes.set_yticks(range(count), names)
    axes.spines[:].set_visible(False)
    figure.colorbar(image, ax=axes, shrink=0.7, label="win + draw / 2")
    title = f"{standings.scenario}: score of the row against the column"
    n = f"n = {standings.games} games of each pair, 95 % intervals"
    save(figure, path, f"{title}\n{n}")
