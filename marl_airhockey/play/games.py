"""Games and their players in recordings; damaged files are skipped."""

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
"""Errors that damaged or foreign files can raise."""


@dataclass(frozen=True)
class Game:
    """Game of a recording, with its players, by seat, and the results of pairs."""

    path: Path
    players: list[Player]
    pairs: list[tuple[str, str, float]]
    """Rows (player, other player, score of the player: 1, 0.5 or 0)."""
    episodes: int
    broken_off: int

    @property
    def people(self) -> tuple[str, ...]:
        """Names of the people in the game."""
        return tuple(sorted(player.name for player in self.players if player.person))


def read_games(
    folder: Path, scenario: str | None = None
) -> tuple[list[Game], list[str]]:
    """Read all recordings in a folder, or those of one scenario.

    Practice games of a study are ignored.

    Returns:
        The games, and a line with the reason for each file that was skipped.

    Raises:
        ValueError: There are no recordings, or several scenarios.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: this folder does not exist")
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
        raise ValueError(
            f"{folder} contains {', '.join(names)}; choose one with --scenario"
        )
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
        raise ValueError(f"{folder}: it contains no recordings{what}{rest}")
    return found, skipped


def _why(path: Path, error: BaseException) -> str:
    """Return a line with the path of a file and its error."""
    words = " ".join(str(error).split()) or type(error).__name__
    if not isinstance(error, ValueError):
        words = f"not a recording of a game: {type(error).__name__}: {words}"
    return words if str(path) in words else f"{path}: {words}"


def _table(head: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a table of the metadata; an empty one if it does not exist."""
    found = head.get(name) or {}
    if not isinstance(found, Mapping):
        raise ValueError(f"{name}: {found!r}; expected a table")
    return found


def _game(path: Path) -> Game:
    """Read the game of a recording.

    Raises:
        ValueError: It is not a recording of a game, or is damaged. Other errors of
            `FOREIGN` are possible.
    """
    recording = read_recording(path)
    scene = scenario_of(recording).scene
    if not recording.episodes:
        raise ValueError("it contains no steps")
    players = [*_players(recording.head)]
    if len(players) != len(scene.seats):
        raise ValueError(f"{len(players)} players for {len(scene.seats)} seats")
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
    """Yield the players in the metadata of a recording.

    In a study a driver has the label of the plan. Otherwise its name includes its
    handicap.
    """
    label = _table(head, "study").get("opponent")
    rows = head.get("players")
    if not isinstance(rows, Sequence) or not all(isinstance(r, Mapping) for r in rows):
        raise ValueError("its meta.json has no list of players")
    for row in rows:
        person, driver = row.get("person"), str(row.get("driver"))
        handicap = Handicap(**_table(row, "handicap")).caption
        shown = f"{driver} ({handicap})" if handicap else driver
        yield Player(str(person or label or shown), person is not None)


def _result(
    players: Sequence[Player], scene: Scene, episode: Episode
) -> list[tuple[str, str, float]]:
    """Add the points of a completed game to its players; return those of pairs."""
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
