"""Cross-play: evaluation of players with teammates that they were not trained with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np

from marl_airhockey.build import scenario_of
from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate
from marl_airhockey.evaluation.stats import bootstrap
from marl_airhockey.rollouts.as_trained import seated_players
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array


@dataclass(frozen=True)
class CrossPlay:
    """Results of E players in teams.

    The player of the row is at ``paddle_0``. The player of the column is at the other
    seats of the team. The diagonal contains teams of a player with itself (self-play).
    """

    scenario: str
    names: tuple[str, ...]
    episodes: int
    """Number of episodes of each pair."""
    returns: Array
    """Mean return, (E, E)."""
    success: Array
    """Share of episodes with success, (E, E)."""

    @property
    def self_play(self) -> float:
        """Mean return of players with themselves."""
        return float(np.diag(self.returns).mean())

    @property
    def cross_play(self) -> float:
        """Mean return of players with others."""
        return float(self.returns[~np.eye(len(self.names), dtype=bool)].mean())

    @property
    def gaps(self) -> Array:
        """Loss of return of each player when it plays with others, in both roles, (E,).

        The mean is the zero-shot coordination gap (Hu and others, 2020).
        """
        count = len(self.names)
        own = np.diag(self.returns)
        with_others = (self.returns + self.returns.T).sum(-1) - 2.0 * own
        return np.asarray(own - with_others / (2.0 * (count - 1)))

    @property
    def gap_interval(self) -> tuple[float, float]:
        """95 % interval of the mean gap, by bootstrap over the players."""
        return bootstrap(self.gaps, lambda gaps: float(gaps.mean()))

    def to_json(self) -> dict[str, Any]:
        """Return all numbers as a JSON object."""
        return {
            "scenario": self.scenario,
            "players": list(self.names),
            "episodes_of_a_pair": self.episodes,
            "return": self.returns.tolist(),
            "success": self.success.tolist(),
            "self_play": self.self_play,
            "cross_play": self.cross_play,
            "gap": float(self.gaps.mean()),
            "gap_interval": list(self.gap_interval),
        }


def crossplay(
    scenario: str,
    players: Mapping[str, object] | Sequence[str],
    *,
    episodes: int = 200,
    seed: int = TEST_SEED,
    exact: bool = False,
    report: Callable[[int], None] = lambda pairs: None,
    **keywords: Unpack[Keywords],
) -> CrossPlay:
    """Let every player play with every other one as its teammate, and with itself.

    Keywords that are not given are those of the training of the policies, which must
    agree.

    Args:
        scenario: Name of a game whose first team has two seats or more.
        players: Two or more players by name, see `registry.make_driver`; or a sequence
            of names of drivers.
        episodes: Number of episodes of each pair. All pairs have the same seeds.
        seed: Seed of the first episode.
        exact: True to use the defaults for keywords that are not given.
        report: Function that is called after each pair with the number of finished
            pairs.
        **keywords: Keywords of the environment; ``drivers`` are those of the other
            teams.

    Raises:
        ValueError: There is only one player, the first team has one seat, or a seat has
            no driver.
    """
    drivers, keywords = seated_players(players, scenario, keywords, exact)
    if len(drivers) < 2:
        raise ValueError("cross-play needs at least two players, of different names")
    seats = scenario_of(scenario, keywords).scene.seats
    teammates = [i for i, s in enumerate(seats) if i and s.team == seats[0].team]
    if not teammates:
        raise ValueError(f"{scenario!r} has no team of two seats or more")
    count, others = len(drivers), keywords.get("drivers", {})
    returns, success = np.empty((2, count, count))
    for i, (name, player) in enumerate(drivers.items()):
        for j, teammate in enumerate(drivers.values()):
            team = {f"paddle_{k}": teammate for k in teammates}
            seated: Keywords = {**keywords, "drivers": {**others, **team}}
            found = evaluate(
                player,
                scenario,
                episodes=episodes,
                seed=seed,
                name=name,
                exact=True,
                **seated,
            )
            returns[i, j], success[i, j] = found.returns, found.success
            report(i * count + j + 1)
    return CrossPlay(scenario, tuple(drivers), episodes, returns, success)
