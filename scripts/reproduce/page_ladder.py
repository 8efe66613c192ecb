"""Measure the levels of the browser page against a model of a person.

    python scripts/reproduce/page_ladder.py --games 100

The model of a person observes the table with a latency of 0.2 s and an error of 12 mm,
and moves its paddle with at most 2.5 m/s. Its tactics are those of the script allround,
which it also uses against fast pucks. It is a model: no person was measured.

The script writes a row per level to docs/data/page_ladder.csv: the share of games that
the model wins, with a 95 % interval, and its goals against those of the level. Further
columns are the goals in games against a player that never moves. A goal for that player
is an own goal of the level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from rows import DATA, write

from marl_airhockey.build import build_world
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.play.handicap import Handicap, HandicappedDriver
from marl_airhockey.play.ladder import Level
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.play import play
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.world.roster import Roster
from marl_airhockey.toolkit.tactics import Scripted, Skill
from marl_airhockey.types import Array

LATENCY, ERROR, HAND = 0.2, 0.012, 2.5
"""Latency of a person, s, its error, m, and the top speed of its hand, m/s."""
GAME_LATENCY, TOP = 0.15, 5.0
"""Latency of observations in a game, s, and top speed of its paddles, m/s."""
BRAVE = 3.0
"""Speed of an approaching puck up to which the person shoots, m/s."""
FILE = DATA / "page_ladder.csv"


class Person(HandicappedDriver):
    """Model of a person, who is used to the own latency and speed."""

    def __init__(self) -> None:
        tactics = make_driver("allround")
        assert isinstance(tactics, Scripted)
        tactics._skill = Skill(HAND / TOP, 0.0)
        tactics.brave = BRAVE  # type: ignore[attr-defined]
        late = LATENCY - GAME_LATENCY
        super().__init__(tactics, Handicap(late, ERROR, HAND / TOP))

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own = view.reaction + self.handicap.reaction
        return super().act(replace(view, reaction=own), memory)


def goals_against(
    player: Driver, levels: Sequence[Level], games: int
) -> tuple[Array, Array]:
    """Let a player play against each of L levels, with an equal number at both ends.

    Returns:
        True for games that the player wins (L, games), and the goals of player and
        level (L, games, 2).
    """
    count = len(levels) * games
    world = build_world("duel", count, False, {}, ["velocity"])
    roster = Roster(world)
    roster.add("player", player)
    for level in levels:
        driver = HandicappedDriver(make_driver(level.driver), level.handicap)
        roster.add(level.name, driver)
    end = np.arange(count) % 2
    rows = np.arange(count)
    roster.seated[rows, end] = 0
    roster.seated[rows, 1 - end] = 1 + rows // games
    world.reset(0)
    roster.begin(rows)
    won, goals = np.zeros(count, np.bool_), np.zeros((count, 2))
    for step in play(world, roster.ask):
        ended = np.flatnonzero(step.ended)
        won[ended] = world.episode.success[ended, end[ended]] > 0
        scored = world.memory["goals"][ended]
        goals[ended] = np.where(end[ended, None] == 0, scored, scored[:, ::-1])
    world.close()
    return won.reshape(-1, games), goals.reshape(-1, games, 2)


def main(
    games: Annotated[int, typer.Option(help="Number of games per level.")] = 100,
) -> None:
    """Measure the levels and write the rows."""
    levels = LiveMatch("duel", {}, {}, seed=0).drivers.ladder
    won, goals = goals_against(Person(), levels, games)
    idle, own = goals_against(make_driver("still"), levels, games)
    rows = []
    for k, level in enumerate(levels):
        low, high = interval(won[k].mean(), games)
        rows.append(
            {
                "level": level.name,
                "driver": level.driver,
                **vars(level.handicap),
                "games": games,
                "person_won": round(won[k].mean(), 3),
                "low": round(low, 3),
                "high": round(high, 3),
                "person_goals": round(goals[k, :, 0].mean(), 2),
                "level_goals": round(goals[k, :, 1].mean(), 2),
                "still_won": round(idle[k].mean(), 3),
                "own_goals": round(own[k, :, 0].mean(), 2),
                "goals_against_still": round(own[k, :, 1].mean(), 2),
            }
        )
    write(FILE, rows)
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*map(str, row.values()))
    Console(width=200).print(table)


if __name__ == "__main__":
    typer.run(main)
