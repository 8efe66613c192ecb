"""What recordings say about players: results, reactions, shots, limits."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.evaluation.recordings import head, read
from marl_airhockey.evaluation.stats import bootstrap, elo, interval, iqm
from marl_airhockey.play.handicap import Fairness
from marl_airhockey.play.measures import MOVES, Player, _watch
from marl_airhockey.types import Array

COMPLETE = "played to the end"
"""How a recording ends whose game was not broken off."""


RESAMPLES = 400


ASIDE = ("diary.jsonl", "erased.jsonl")
"""What a study keeps beside its recordings."""


FEWEST = 5
"""Games without which an Elo has no interval: their results are too often all alike."""


@dataclass
class Report:
    """Players by name, and the games between them."""

    players: dict[str, Player]
    games: list[tuple[str, str, float]]
    """Two players and the first one's score"""
    episodes: int
    broken_off: int

    def rows(self) -> list[dict[str, Any]]:
        """One row a player, those with most games first; nan where nothing was seen."""
        ratings = self._ratings()
        ranked = sorted(self.players.values(), key=lambda p: (-p.games, p.name))
        return [
            {
                "player": p.name,
                "person": p.person,
                "games": p.games,
                "score": _share(p.won + 0.5 * p.drawn, p.games),
                "elo": ratings.get(p.name, [float("nan")] * 3),
                "hit_rate": _share(sum(p.comes), len(p.comes)),
                "reaction_ms": [1000 * x for x in _middle(p.reactions)],
                "shot_speed": _middle(p.shots),
                "shot_spread": float(np.std(p.places)) if p.places else float("nan"),
                "limited": p.limited / p.steps if p.steps else float("nan"),
                "round_trip_ms": _middle(p.delays)[0],
            }
            for p in ranked
        ]

    def _ratings(self) -> dict[str, list[float]]:
        """Elo of each player with its 95 % interval, games resampled."""
        names = sorted({name for a, b, _ in self.games for name in (a, b)})
        if len(names) < 2:
            return {}
        rng = np.random.default_rng(0)
        count = len(self.games)

        def rate(chosen: Array) -> Array:
            score, played = np.zeros((2, len(names), len(names)))
            for k in chosen:
                a, b, share = self.games[k]
                i, j = names.index(a), names.index(b)
                score[i, j] += share
                score[j, i] += 1.0 - share
                played[i, j] += 1
                played[j, i] += 1
            return elo(score, played)

        middle = rate(np.arange(count))
        drawn = [rate(rng.integers(0, count, count)) for _ in range(RESAMPLES)]
        low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
        enough = [sum(name in game[:2] for game in self.games) for name in names]
        low[np.array(enough) < FEWEST] = high[np.array(enough) < FEWEST] = np.nan
        return {
            name: [float(middle[i]), float(low[i]), float(high[i])]
            for i, name in enumerate(names)
        }

    def to_markdown(self) -> str:
        """A table."""
        lines = [
            f"# {self.episodes} recorded episodes, {self.broken_off} broken off",
            "",
            "| player | games | score (95 %) | Elo (95 %) | pucks met (95 %) "
            "| reaction, ms (95 %) | shot, m/s (95 %) | spread of shots, m "
            "| at limits | round trip, ms |",
            "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        ]
        for row in self.rows():
            lines.append(
                f"| {row['player']} | {row['games']} | {shown(row['score'], 2)} "
                f"| {shown(row['elo'], 0)} | {shown(row['hit_rate'], 2)} "
                f"| {shown(row['reaction_ms'], 0)} | {shown(row['shot_speed'], 2)} "
                f"| {_number(row['shot_spread'], 3)} | {_number(row['limited'], 2)} "
                f"| {_number(row['round_trip_ms'], 0)} |"
            )
        lines += [
            "",
            "Score: win + draw / 2, of games played to the end. Reaction: from a serve "
            f"to the first movement above {MOVES} m/s. Shots: pucks that left the "
            "paddle toward the other end; their interquartile mean speed, and the "
            "deviation of where they would reach that end. An Elo of fewer than "
            f"{FEWEST} games has no interval. At limits: share of the "
            "steps in which what was asked exceeded speed, acceleration or reach.",
        ]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write ``report.json``, ``report.md`` and ``report.png``."""
        from marl_airhockey.play.plots import picture

        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"report.{kind}" for kind in ("json", "md", "png")]
        data = {"episodes": self.episodes, "broken_off": self.broken_off}
        rows = [{k: _plain(v) for k, v in row.items()} for row in self.rows()]
        files[0].write_text(json.dumps({**data, "players": rows}, indent=1))
        files[1].write_text(self.to_markdown())
        picture(self, files[2])
        return files


def report(folder: Path, scenario: str | None = None) -> Report:
    """Read all recordings under a folder, or those of one scenario.

    Practice games of a study are left out.

    Raises:
        ValueError: there is none, a file that is no recording, or several scenarios.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: there is no such folder")
    read_ones = [
        read(path)
        for path in sorted(folder.rglob("*.jsonl"))
        if path.name not in ASIDE and not head(path).get("study", {}).get("practice")
    ]
    games = sorted({meta["court"]["scenario"] for meta, _, _ in read_ones})
    if scenario is None and len(games) > 1:
        raise ValueError(f"{folder} has {', '.join(games)}: choose one by --scenario")
    wanted = [r for r in read_ones if scenario in (None, r[0]["court"]["scenario"])]
    if not wanted:
        what = f" of {scenario}" if scenario else ""
        raise ValueError(f"{folder}: there are no recordings{what} (*.jsonl) in it")
    found = Report({}, [], len(wanted), 0)
    for meta, steps, end in wanted:
        _add(found, meta, steps, end)
    return found


def _add(
    found: Report,
    meta: dict[str, Any],
    steps: list[dict[str, Any]],
    end: dict[str, Any],
) -> None:
    """Take an episode into a report."""
    seats, players = meta["court"]["seats"], []
    for row in meta["players"]:
        name = row["person"] or _program(row["driver"], meta["fairness"])
        known = found.players.setdefault(name, Player(name, row["person"] is not None))
        players.append(known)
    complete = end.get("reason") == COMPLETE
    found.broken_off += not complete
    teams = [seat["team"] for seat in seats]
    if complete and len(set(teams)) > 1:
        _result(found, players, teams, end["success"])
    for i, player in enumerate(players):
        _watch(player, i, seats[i], meta, steps)


def _program(name: str, fairness: dict[str, float]) -> str:
    """A program's name, with how it was held back."""
    held = Fairness(**fairness).words
    return f"{name} ({held})" if held else name


def _result(
    found: Report, players: Sequence[Player], teams: Sequence[int], won: Sequence[bool]
) -> None:
    anybody = any(won)
    for i, player in enumerate(players):
        player.won += won[i]
        player.drawn += not anybody
        player.lost += anybody and not won[i]
        for j in range(i + 1, len(players)):
            if teams[i] != teams[j] and won[i] + won[j] < 2:
                share = 0.5 + 0.5 * (won[i] - won[j])
                found.games.append((player.name, players[j].name, share))


def _plain(value: Any) -> Any:
    """For JSON, which has no nan."""
    if isinstance(value, list):
        return [_plain(x) for x in value]
    return None if isinstance(value, float) and np.isnan(value) else value


def _share(part: float, whole: int) -> list[float]:
    """A share with its 95 % interval."""
    if not whole:
        return [float("nan")] * 3
    return [part / whole, *interval(part / whole, whole)]


def _middle(values: Sequence[float]) -> list[float]:
    """An interquartile mean with its 95 % interval."""
    if not len(values):
        return [float("nan")] * 3
    rows = np.array(values)
    return [iqm(rows), *bootstrap(rows, iqm, resamples=RESAMPLES)]


def _number(value: float, digits: int) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def shown(values: Sequence[float], digits: int) -> str:
    """A figure with its interval, if it has one; "-" for none."""
    middle, low, high = values
    if np.isnan(middle):
        return "-"
    if np.isnan(low):
        return f"{middle:.{digits}f}"
    return f"{middle:.{digits}f} ({low:.{digits}f}..{high:.{digits}f})"
