"""Demonstration: policies that play behind the start screen."""

from __future__ import annotations

from typing import Any

from marl_airhockey.play.live_match import LiveMatch

DRAWN = (
    *("time", "paddles", "pucks", "puck_angles"),
    *("blocks", "angles", "marks", "eliminated"),
)
"""Fields of a state of a match that change the image of the table."""


WITHOUT_POLICY = "sticky"
"""Driver of a task without a policy; it suits every task."""


class Demonstration:
    """Match of the best policies that is repeated, apart from the people's match."""

    def __init__(self) -> None:
        self._match: LiveMatch | None = None

    def tick(self, match: LiveMatch) -> None:
        """Advance the demonstration by a tick.

        Args:
            match: Match of the people, which defines scenario and keywords.
        """
        if self._match is None:
            self._match = LiveMatch(match.scenario, {}, match.keywords)
            drivers, seats = self._match.drivers, range(len(self._match.seats))
            best = drivers.ladder[-1].driver
            if len(seats) == 1 and not drivers.fitting_policies:
                best = WITHOUT_POLICY
            for i in seats:
                self._match.set_driver(i, best)
        if self._match.phase in ("lobby", "done"):
            self._match.start()
            self._match.time_left = 0.0
        self._match.tick()

    def state(self) -> dict[str, Any] | None:
        """Return the fields `DRAWN` of its state, and a number of steps ``n``."""
        if self._match is None:
            return None
        state = self._match.state()
        drawn = {name: state[name] for name in DRAWN}
        return {**drawn, "n": self._match.number * 100_000 + self._match.ticks}

    def end(self) -> None:
        """Close the drivers and the world; the next tick starts another one."""
        if self._match is not None:
            self._match.close()
        self._match = None
