"""Menu of the games that a table offers, and the preparation of a chosen one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.messages import title_of
from marl_airhockey.registry import make_scenario


class GameMenu:
    """Games among which players choose.

    A game is prepared in a thread, because its loops may have to be compiled.

    Args:
        names: Names of the scenarios; empty if the table has a single game.
        prepare: Function that returns a match of a scenario with drivers in its seats.
    """

    def __init__(
        self,
        names: Sequence[str] = (),
        prepare: Callable[[str], LiveMatch] | None = None,
    ) -> None:
        self.names, self._prepare = names, prepare
        self.opening = ""
        """Name of the game that is being prepared; "" for none."""
        self._worker = ThreadPoolExecutor(1, "game") if names else None
        self._prepared: Future[LiveMatch] | None = None

    @property
    def rows(self) -> list[dict[str, Any]]:
        """JSON of the menu: name, title and number of seats of each game."""
        found = {name: make_scenario(name) for name in self.names}
        return [
            {
                "name": name,
                "title": title_of(scenario),
                "seats": len(scenario.scene.seats),
            }
            for name, scenario in found.items()
        ]

    def choose(self, name: str) -> None:
        """Start to prepare a game; ignore an unknown name, or a second choice."""
        if name in self.names and not self.opening and self._worker and self._prepare:
            self.opening = name
            self._prepared = self._worker.submit(self._prepare, name)

    def take(self) -> LiveMatch | None:
        """Return the match of a chosen game once it is prepared, else None.

        Raises:
            Exception: The preparation failed.
        """
        if self._prepared is None or not self._prepared.done():
            return None
        prepared, self._prepared, self.opening = self._prepared, None, ""
        return prepared.result()

    def close(self) -> None:
        """Wait for a preparation and end the thread."""
        if self._worker is not None:
            self._worker.shutdown(cancel_futures=True)
