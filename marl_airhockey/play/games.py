"""Games: what recordings say of the players; a file that makes no sense is skipped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marl_airhockey.data.reader import read_head, read_recording
from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.measures import Player, measure
from marl_airhockey.rollouts.columns import scenario_of
from marl_airhockey.sim.core.recording import META, PLAYED, Episode, Recording
from marl_airhockey.sim.core.scene import Scene

FOREIGN = (
    *(ValueError, TypeError, KeyError, IndexError, AttributeError),
    *(ArithmeticError, OSError, RecursionError, MemoryError),
)
"""Errors of files that others have made or changed"""


@dataclass(frozen=True)
class Game:
    """Game of a recording: its players, by seat, and who has won against whom."""

    path: Path
    players: list[Player]
    pairs: list[tuple[str, str, float]]
    """Rows (player, other player, score of the first: 1, 0.5 or 0)."""
    episodes: int
    broken_off: int

    @property
    def people(self) -> tuple[str, ...]:
        """Names of the people in it."""
        return tuple(sorted(player.name for player in self.players if player.person))


def read_games(
    folder: Path, scenario: str | None = None
) -> tuple[list[Game], list[str]]:
    """Read all recordings under a folder, or those of one scenario.

    Practice games of a study are left out.

    Returns:
        The games, and a line for each file that was skipped.

    Raises:
        ValueError: No recording, or several scenarios.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: there is no such folder")
    heads: dict[Path, dict[str, Any]] = {}
    skipped: list[str] = []
    for path in (meta.parent for meta in sorted(folder.rglob(META))):
        try:
            head = read_head(path)
            scenario_of(Recording(path, head, []))
            if not _table(head, "study").get("practice"):
                heads[path] = head
        except FOREIGN as error:
            skipped.append(_why(path, error))
    names = sorted({head["scenario"] for head in heads.values()})
    if scenario is None and len(names) > 1:
        raise ValueError(f"{folder} has {', '.join(names)}: choose one by --scenario")
    found = []
    for path, head in heads.items():
        if scenario in (None, head["scenario"]):
            try:
                found.append(_game(path))
            except FOREIGN as error:
                skipped.append(_why(path, error))
    if not found:
        what = f" of {scenario}" if scenario else ""
        rest = f"; skipped: {'; '.join(skipped)}" if skipped else ""
        raise ValueError(f"{folder}: there are no recordings{what} in it{rest}")
    return found, skipped


def _why(path: Path, error: BaseException) -> str:
    """Return a line that names a file and what is wrong with it."""
    words = " ".join(str(error).split()) or type(error).__name__
    if not isinstance(error, ValueError):
        words = f"no recording of a game: {type(error).__name__}: {words}"
    return words if str(path) in words else f"{path}: {words}"


def _table(head: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a table of a head; an empty one if there is none."""
    found = head.get(name) or {}
    if not isinstance(found, Mapping):
        raise ValueError(f"{name}: {found!r} is no table")
    return found


def _game(path: Path) -> Game:
    """Read a recording.

    Raises:
        ValueError: It is none of a game, or makes no sense. Others of `FOREIGN`, too.
    """
    recording = read_recording(path)
    scene = scenario_of(recording).scene
    if not recording.episodes:
        raise ValueError("there are no steps in it")
    players = [*_players(recording.head)]
    if len(players) != len(scene.seats):
        raise ValueError(f"{len(players)} players at {len(scene.seats)} seats")
    pairs: list[tuple[str, str, float]] = []
    for episode in recording.episodes:
        if episode.reason == PLAYED and len(episode):
            pairs += _result(players, scene, episode)
        if len(episode):
            for i, player in enumerate(players):
                measure(player, i, scene, episode)
    count = len(recording.episodes)
    broken = sum(episode.reason != PLAYED for episode in recording.episodes)
    return Game(path, players, pairs, count, broken)


def _players(head: Mapping[str, Any]) -> Iterable[Player]:
    """Yield the players of a head.

    A driver is named as the plan of a study names it; elsewhere with its handicap.
    """
    label = _table(head, "study").get("opponent")
    handicap = Handicap(**_table(head, "handicap")).caption
    rows = head.get("players")
    if not isinstance(rows, Sequence) or not all(isinstance(r, Mapping) for r in rows):
        raise ValueError("it does not name its players")
    for row in rows:
        person, driver = row.get("person"), str(row.get("driver"))
        shown = f"{driver} ({handicap})" if handicap else driver
        yield Player(str(person or label or shown), person is not None)


def _result(
    players: Sequence[Player], scene: Scene, episode: Episode
) -> list[tuple[str, str, float]]:
    """Count a game that was played to the end, for each player and each pair."""
    teams = [seat.team for seat in scene.seats]
    if len(set(teams)) == 1:
        return []
    won = [bool(share) for share in episode.columns["success"][-1]]
    pairs = []
    for i, player in enumerate(players):
        player.points.append(1.0 if won[i] else 0.0 if any(won) else 0.5)
        for j in range(i + 1, len(players)):
            if teams[i] != teams[j] and won[i] + won[j] < 2:
                share = 0.5 + 0.5 * (won[i] - won[j])
                pairs.append((player.name, players[j].name, share))
    return pairs
