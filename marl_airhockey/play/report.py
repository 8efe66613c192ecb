"""Report of recordings by player, with results, shots and limits."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from operator import add
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.evaluation.stats import (
    FEWEST_GROUPS,
    elo,
    interval,
    iqm,
    jackknife,
    without_nan,
)
from marl_airhockey.play.cells import markdown, number, shown
from marl_airhockey.play.games import Game, read_games
from marl_airhockey.play.measures import Player
from marl_airhockey.types import Array

MOST_GROUPS = 60
"""Largest number of groups of games for an interval."""
NAN = float("nan")
HEADER = (
    *("player", "games", "people", "score (95 %)", "Elo (95 %)", "pucks hit (95 %)"),
    *("shots", "shot, m/s (95 %)", "spread of shots, m", "at limits", "round trip, ms"),
)
LEGEND = (
    "Score: win + draw / 2, of completed games. Shots: pucks that left the paddle "
    "toward the other end, with their interquartile mean speed and the standard "
    "deviation of the position at which they would reach that end. At limits: share of "
    "the steps whose action exceeded a limit of speed, acceleration or workspace. "
    "Intervals of a driver are over the people that it met, because the games of a "
    "person are not independent. Intervals of a person, and of drivers without people, "
    f"are over games. There is no interval for fewer than {FEWEST_GROUPS}."
)


@dataclass
class Report:
    """Measurements of all players, and the games between them."""

    games: list[Game]
    skipped: list[str] = field(default_factory=list)
    """Lines with the reason for each file that was skipped."""

    @property
    def episodes(self) -> int:
        """Number of episodes."""
        return sum(game.episodes for game in self.games)

    @property
    def broken_off(self) -> int:
        """Number of episodes that were not completed."""
        return sum(game.broken_off for game in self.games)

    @cached_property
    def _groups(self) -> dict[str, list[Player]]:
        """Measurements by player, in independent groups."""
        found: dict[str, dict[object, Player]] = {}
        for game in self.games:
            for player in game.players:
                unit = game.path if player.person else game.people or game.path
                own = found.setdefault(player.name, {})
                own[unit] = own[unit] + player if unit in own else player
        return {name: _merged(list(own.values())) for name, own in found.items()}

    @cached_property
    def players(self) -> dict[str, Player]:
        """Measurements of each player, by name."""
        return {name: reduce(add, groups) for name, groups in self._groups.items()}

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each player, sorted by the number of games.

        Values with an interval are lists (value, low, high), with nan for no interval.
        """
        ratings = self._ratings()
        ranked = sorted(self.players.values(), key=lambda p: (-p.games, p.name))
        return [self._row(player, ratings) for player in ranked]

    def _row(self, p: Player, ratings: dict[str, list[float]]) -> dict[str, Any]:
        groups = self._groups[p.name]
        met = {
            name
            for game in self.games
            if p.name in [player.name for player in game.players]
            for name in game.people
        }
        return {
            "player": p.name,
            "person": p.person,
            "games": p.games,
            "people": len(met),
            "score": share([group.points for group in groups]),
            "elo": ratings.get(p.name, [NAN] * 3),
            "hit_rate": share([group.interceptions for group in groups]),
            "shots": len(p.shot_speeds),
            "shot_speed": _mean_speed([group.shot_speeds for group in groups]),
            "shot_spread": float(np.std(p.shot_placements or NAN)),
            "limited": p.limited / p.steps if p.steps else NAN,
            "round_trip_ms": iqm(np.array(p.delays)) if p.delays else NAN,
        }

    def _ratings(self) -> dict[str, list[float]]:
        """Return the Elo rating of each player with its 95 % interval."""
        units: dict[object, list[tuple[str, str, float]]] = {}
        for game in self.games:
            if game.pairs:
                units.setdefault(game.people or game.path, []).extend(game.pairs)
        groups = _split(list(units.values()))
        names = sorted(
            {name for game in self.games for p in game.pairs for name in p[:2]}
        )
        if len(names) < 2:
            return {}

        def rate(chosen: list[int]) -> Array:
            """Return the Elo rating of each name from some groups of games."""
            score, played = np.zeros((2, len(names), len(names)))
            for a, b, points in (pair for k in chosen for pair in groups[k]):
                i, j = names.index(a), names.index(b)
                score[i, j] += points
                score[j, i] += 1.0 - points
                played[i, j] += 1
                played[j, i] += 1
            return elo(score, played)

        ratings = rate(list(range(len(groups))))
        low = high = np.full(len(names), NAN)
        if len(groups) >= FEWEST_GROUPS:
            low, high = jackknife(len(groups), rate)
        enough = [
            sum(any(name in pair[:2] for pair in group) for group in groups)
            for name in names
        ]
        return {
            name: [float(ratings[i]), float(low[i]), float(high[i])]
            if enough[i] >= FEWEST_GROUPS
            else [float(ratings[i]), NAN, NAN]
            for i, name in enumerate(names)
        }

    def to_markdown(self) -> str:
        """Return a table with a legend."""
        rows = [
            (
                *(row["player"], row["games"], row["people"]),
                *(shown(row["score"], 2), shown(row["elo"], 0)),
                *(shown(row["hit_rate"], 2), row["shots"], shown(row["shot_speed"], 2)),
                *(number(row["shot_spread"], 3), number(row["limited"], 2)),
                number(row["round_trip_ms"], 0),
            )
            for row in self.rows()
        ]
        title = f"# {self.episodes} recorded episodes, {self.broken_off} not completed"
        skipped = [f"* skipped: {line}" for line in self.skipped]
        lines = [title, "", *markdown(HEADER, rows), "", LEGEND, *skipped]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write ``report.json`` and ``report.md``; return their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"report.{kind}" for kind in ("json", "md")]
        counts = {"episodes": self.episodes, "broken_off": self.broken_off}
        data = {**counts, "players": self.rows(), "skipped": self.skipped}
        files[0].write_text(json.dumps(without_nan(data), indent=1))
        files[1].write_text(self.to_markdown())
        return files


def summarize(folder: Path, scenario: str | None = None) -> Report:
    """Return the report of all recordings in a folder, or of those of one scenario.

    Raises:
        ValueError: See `games.read_games`.
    """
    return Report(*read_games(folder, scenario))


def _split(groups: list[list[Any]]) -> list[list[Any]]:
    """Return at most `MOST_GROUPS` groups; further groups are merged into them."""
    count = min(len(groups), MOST_GROUPS)
    return [[x for group in groups[k::count] for x in group] for k in range(count)]


def _merged(players: list[Player]) -> list[Player]:
    return [reduce(add, group) for group in _split([[p] for p in players])]


def _mean_speed(groups: Sequence[Sequence[float]]) -> list[float]:
    """Return the interquartile mean of speeds, m/s, with its 95 % interval.

    The interval is that of the logarithm, so that it has no negative speeds.
    """
    found = middle(groups, lambda speeds: np.log(iqm(speeds)))
    return [float(np.exp(value)) for value in found]


def share(groups: Sequence[Sequence[float]]) -> list[float]:
    """Return the mean of points 0 .. 1 in groups with its 95 % interval.

    The interval is that of Wilson (1927) for one point per group, or if all means are
    the same. Otherwise it is computed by a jackknife.
    """
    groups = [group for group in groups if len(group)]
    value = middle(groups, np.mean)
    if len(groups) < FEWEST_GROUPS:
        return value
    means = [float(np.mean(group)) for group in groups]
    if all(len(group) == 1 for group in groups) or len(set(means)) == 1:
        return [value[0], *interval(value[0], len(groups))]
    return [value[0], max(value[1], 0.0), min(value[2], 1.0)]


def middle(
    groups: Sequence[Sequence[float]], statistic: Callable[[Array], Any]
) -> list[float]:
    """Return a statistic of values in groups with its 95 % jackknife interval."""
    groups = [group for group in groups if len(group)]
    if not groups:
        return [NAN] * 3

    def of(chosen: list[int]) -> Array:
        return np.asarray(statistic(np.concatenate([groups[k] for k in chosen])))

    if len(groups) < FEWEST_GROUPS:
        return [float(of(list(range(len(groups))))), NAN, NAN]
    low, high = jackknife(len(groups), of)
    return [float(of(list(range(len(groups))))), float(low), float(high)]
