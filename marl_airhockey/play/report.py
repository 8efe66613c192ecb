"""Report of recordings, by player: results, reactions, shots, limits."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.core.recording import META, PLAYED, RecordedEpisode
from marl_airhockey.core.scene import Scene
from marl_airhockey.data.columns import scenario_of
from marl_airhockey.data.reader import read_head, read_recording
from marl_airhockey.evaluation.stats import bootstrap, elo, interval, iqm
from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.measures import MOVING, Player, measure
from marl_airhockey.types import Array

RESAMPLES = 400
"""Bootstrap resamples of an interval."""
FEWEST = 5
"""Games from which an Elo has an interval: fewer have too often all the same result."""


@dataclass
class Report:
    """Measurements of all players, and the games between them."""

    players: dict[str, Player]
    """Measurements by the player's name."""
    games: list[tuple[str, str, float]]
    """Rows (player, other player, score of the first: 1, 0.5 or 0)."""
    episodes: int
    broken_off: int

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each player, those with most games first.

        Values with an interval are lists (value, low, high); nan where there is none.
        """
        ratings = self._ratings()
        ranked = sorted(self.players.values(), key=lambda p: (-p.games, p.name))
        return [
            {
                "player": p.name,
                "person": p.person,
                "games": p.games,
                "score": _share(p.won + 0.5 * p.drawn, p.games),
                "elo": ratings.get(p.name, [float("nan")] * 3),
                "hit_rate": _share(sum(p.interceptions), len(p.interceptions)),
                "reaction_ms": [1000 * x for x in _middle(p.reactions)],
                "shot_speed": _middle(p.shot_speeds),
                "shot_spread": _spread(p.shot_placements),
                "limited": _share(p.limited, p.steps)[0],
                "round_trip_ms": _middle(p.delays)[0],
            }
            for p in ranked
        ]

    def _ratings(self) -> dict[str, list[float]]:
        """Return the Elo of each player with its 95 % interval, games resampled."""
        names = sorted({name for a, b, _ in self.games for name in (a, b)})
        if len(names) < 2:
            return {}
        rng = np.random.default_rng(0)
        count = len(self.games)

        def rate(chosen: Array) -> Array:
            """Return the Elo of each name from some games."""
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
        resampled = [rate(rng.integers(0, count, count)) for _ in range(RESAMPLES)]
        low, high = np.quantile(resampled, [0.025, 0.975], axis=0)
        enough = [sum(name in game[:2] for game in self.games) for name in names]
        low[np.array(enough) < FEWEST] = high[np.array(enough) < FEWEST] = np.nan
        return {
            name: [float(middle[i]), float(low[i]), float(high[i])]
            for i, name in enumerate(names)
        }

    def to_markdown(self) -> str:
        """Return a table with a legend."""
        lines = [
            f"# {self.episodes} recorded episodes, {self.broken_off} broken off",
            "",
            "| player | games | score (95 %) | Elo (95 %) | pucks hit (95 %) "
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
            f"to the first movement above {MOVING} m/s. Shots: pucks that left the "
            "paddle toward the other end; their interquartile mean speed, and the "
            "deviation of where they would reach that end. An Elo of fewer than "
            f"{FEWEST} games has no interval. At limits: share of the "
            "steps whose action exceeded speed, acceleration or reach.",
        ]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write ``report.json`` and ``report.md``; return their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"report.{kind}" for kind in ("json", "md")]
        data = {"episodes": self.episodes, "broken_off": self.broken_off}
        rows = [{k: _plain(v) for k, v in row.items()} for row in self.rows()]
        files[0].write_text(json.dumps({**data, "players": rows}, indent=1))
        files[1].write_text(self.to_markdown())
        return files


def summarize(folder: Path, scenario: str | None = None) -> Report:
    """Read all recordings under a folder, or those of one scenario.

    Practice games of a study are left out.

    Raises:
        ValueError: no recording, several scenarios, or a file that cannot be read.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: there is no such folder")
    paths = [meta.parent for meta in sorted(folder.rglob(META))]
    heads = {path: read_head(path) for path in paths}
    heads = {p: h for p, h in heads.items() if not h.get("study", {}).get("practice")}
    games = sorted({head["scenario"] for head in heads.values()})
    if scenario is None and len(games) > 1:
        raise ValueError(f"{folder} has {', '.join(games)}: choose one by --scenario")
    chosen = [p for p, h in heads.items() if scenario in (None, h["scenario"])]
    if not chosen:
        what = f" of {scenario}" if scenario else ""
        raise ValueError(f"{folder}: there are no recordings{what} in it")
    found = Report({}, [], 0, 0)
    for path in chosen:
        recording = read_recording(path)
        scene = scenario_of(recording).scene
        for episode in recording.episodes:
            _add(found, recording.head, scene, episode)
    return found


def _add(
    found: Report, head: dict[str, Any], scene: Scene, episode: RecordedEpisode
) -> None:
    """Add an episode to a report."""
    players, handicap = [], head.get("handicap")
    for row in head["players"]:
        name = row["person"] or _program(row["driver"], handicap)
        known = found.players.setdefault(name, Player(name, row["person"] is not None))
        players.append(known)
    complete = episode.reason == PLAYED
    found.episodes += 1
    found.broken_off += not complete
    teams = [seat.team for seat in scene.seats]
    if complete and len(set(teams)) > 1:
        success = episode.columns["success"][-1]
        won = [bool(success[i]) for i in range(len(teams))]
        _result(found, players, teams, won)
    if len(episode):
        for i, player in enumerate(players):
            measure(player, i, scene, episode, head["control_dt"])


def _program(name: str, handicap: dict[str, float] | None) -> str:
    """Return a program's name, with its handicap if it has one."""
    caption = Handicap(**handicap).caption if handicap else ""
    return f"{name} ({caption})" if caption else name


def _result(
    found: Report, players: Sequence[Player], teams: Sequence[int], won: Sequence[bool]
) -> None:
    """Count a game that was played to the end, for each player and each pair."""
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
    """Return a value with None for nan, which JSON does not have."""
    if isinstance(value, list):
        return [_plain(x) for x in value]
    return None if isinstance(value, float) and np.isnan(value) else value


def _share(part: float, whole: int) -> list[float]:
    """Return a share with its 95 % interval."""
    if not whole:
        return [float("nan")] * 3
    return [part / whole, *interval(part / whole, whole)]


def _middle(values: Sequence[float]) -> list[float]:
    """Return an interquartile mean with its 95 % interval."""
    if not len(values):
        return [float("nan")] * 3
    rows = np.array(values)
    return [iqm(rows), *bootstrap(rows, iqm, resamples=RESAMPLES)]


def _spread(values: Sequence[float]) -> float:
    """Return the standard deviation; nan for no values."""
    return float(np.std(values)) if len(values) else float("nan")


def _number(value: float, digits: int) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def shown(values: Sequence[float], digits: int) -> str:
    """Return a value with its interval, if it has one, as text; "-" for nan."""
    middle, low, high = values
    if np.isnan(middle):
        return "-"
    if np.isnan(low):
        return f"{middle:.{digits}f}"
    return f"{middle:.{digits}f} ({low:.{digits}f}..{high:.{digits}f})"
