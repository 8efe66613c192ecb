"""Knock-out tournament: names, rounds of pairs, and a table of results."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

LONGEST_NAME = 20
"""Largest number of characters of a name."""
MOST = 64
"""Largest number of players."""


@dataclass
class Pairing:
    """Match of a tournament between two players, given by their keys."""

    players: tuple[str, ...]
    """Keys of the players; a single one has a bye."""
    goals: tuple[int, ...] = ()
    winner: str = ""
    """Key of the winner; "" before the end."""


@dataclass
class Tournament:
    """Knock-out tournament. The loser of a match is out; an odd player has a bye."""

    names: dict[str, str] = field(default_factory=dict)
    """Names of the players by key, in the order of entry."""
    rounds: list[list[Pairing]] = field(default_factory=list)
    """Pairs of each round; empty before the begin."""

    def enter(self, key: str, name: str) -> None:
        """Enter a player, or change the name, before the begin.

        Raises:
            ValueError: The name is empty, too long or taken, or there are too many
                players.
        """
        name = " ".join(name.split())
        others = [taken for other, taken in self.names.items() if other != key]
        if not 0 < len(name) <= LONGEST_NAME:
            raise ValueError(f"a name has 1 to {LONGEST_NAME} characters")
        if name.lower() in [other.lower() for other in others]:
            raise ValueError(f"{name} is taken; choose another name")
        if len(others) == MOST:
            raise ValueError(f"a tournament has at most {MOST} players")
        if not self.rounds:
            self.names[key] = name

    def withdraw(self, key: str) -> None:
        """Remove a player before the begin."""
        if not self.rounds:
            self.names.pop(key, None)

    def begin(self) -> None:
        """Pair the players of the first round, if there are two or more."""
        if len(self.names) > 1 and not self.rounds:
            self.rounds.append(_paired(list(self.names)))

    @property
    def current(self) -> Pairing | None:
        """Pair that plays next or now; None before the begin and after the end."""
        unplayed = (pair for pairs in self.rounds for pair in pairs if not pair.winner)
        return next(unplayed, None)

    @property
    def champion(self) -> str:
        """Key of the winner of the last round; "" before the end."""
        over = self.rounds and self.current is None
        return self.rounds[-1][0].winner if over else ""

    def finish(self, winner: int, goals: tuple[int, ...] = ()) -> None:
        """Store the result of the current pair, and pair the next round if it is over.

        Args:
            winner: Index of the winner in the pair.
            goals: Goals of both players; empty for a match that was not played.
        """
        pair = self.current
        if pair is None:
            return
        pair.winner, pair.goals = pair.players[winner], goals
        winners = [pair.winner for pair in self.rounds[-1]]
        if all(winners) and len(winners) > 1:
            self.rounds.append(_paired(winners))

    def state(self) -> dict[str, Any]:
        """Return the JSON of the tournament, with names instead of keys."""
        current = self.current
        return {
            "players": list(self.names.values()),
            "rounds": [[self._row(pair) for pair in pairs] for pairs in self.rounds],
            "current": self._row(current) if current else None,
            "champion": self.names.get(self.champion, ""),
            "table": list(self._table()),
        }

    def _row(self, pair: Pairing) -> dict[str, Any]:
        return {
            "players": [self.names[key] for key in pair.players],
            "goals": list(pair.goals),
            "winner": self.names.get(pair.winner, ""),
        }

    def _table(self) -> Iterator[dict[str, Any]]:
        """Yield played matches, wins and goals of the players, the best first."""
        played = [p for pairs in self.rounds for p in pairs if p.goals]
        rows = []
        for key, name in self.names.items():
            own = [p for p in played if key in p.players]
            mine = sum(p.goals[p.players.index(key)] for p in own)
            others = sum(sum(p.goals) for p in own) - mine
            won = sum(p.winner == key for p in own)
            rows.append((won, mine - others, mine, others, len(own), name))
        rows.sort(key=lambda row: (-row[0], -row[1], -row[2], row[5]))
        for won, _, mine, others, count, name in rows:
            goals = f"{mine} : {others}"
            yield {"name": name, "played": count, "won": won, "goals": goals}


def _paired(keys: list[str]) -> list[Pairing]:
    """Return the pairs of a round; the last of an odd number has a bye."""
    pairs = [Pairing(tuple(keys[i : i + 2])) for i in range(0, len(keys), 2)]
    if len(keys) % 2:
        pairs[-1].winner = keys[-1]
        pairs.insert(0, pairs.pop())  # Another player has the next bye.
    return pairs
