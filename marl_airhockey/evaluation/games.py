"""Games between players: winners and margins of many games in one batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from marl_airhockey.build import build_world, scenario_of
from marl_airhockey.rollouts.play import play
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.roster import Roster
from marl_airhockey.types import Array


@dataclass(frozen=True)
class GameResults:
    """Results of G games of T teams."""

    won: Array
    """True for the winner, (G, T) bool; all False in a draw."""
    margin: Array
    """Mean return of the seats of a team: goals for minus goals against, (G, T)."""
    lasted: Array
    """Time at which the last seat of a team was eliminated, s, (G, T); infinite if none
    was."""
    seconds: Array
    """Length of the games, s, (G,)."""

    @property
    def score(self) -> Array:
        """Points, (G, T): 1 for a win, and an equal share of 1 for a draw."""
        drawn = ~self.won.any(-1, keepdims=True)
        return np.asarray(self.won + drawn / self.won.shape[1])

    @property
    def ahead(self) -> Array:
        """True where the first team is ranked before the second, (G, T, T) bool.

        The winner is first. The other teams are ordered by the time of their
        elimination, the latest first, and then by their margin.
        """
        ahead = np.zeros((*self.won.shape, self.won.shape[1]), np.bool_)
        equal = np.ones_like(ahead)
        for merit in (self.won, self.lasted, self.margin):
            first, second = merit[:, :, None], merit[:, None]
            ahead |= equal & (first > second)
            equal &= first == second
        return ahead

    @staticmethod
    def joined(parts: Sequence[GameResults]) -> GameResults:
        """Return the results of several batches as one."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return GameResults(*map(np.concatenate, columns))


def teams_of(seats: Sequence[int]) -> Array:
    """Return the number of the team of each seat, (seats,), from 0 without gaps."""
    return np.unique(np.asarray(seats), return_inverse=True)[1]


def play_against(
    scenario: str,
    player: Driver,
    opponents: Sequence[Driver],
    games: int,
    seed: int,
    keywords: Keywords | None = None,
) -> tuple[Array, Array]:
    """Let one player play against each of R opponents, which fill all other teams.

    Args:
        scenario: Name of a game.
        player: Driver of the player. It changes ends from game to game.
        opponents: Drivers of the opponents.
        games: Number of games against each opponent.
        seed: Seed of the first game.
        keywords: Keywords of the environment.

    Returns:
        Mean score and mean margin of the player against each opponent, (R,) each.
    """
    keywords = keywords or {}
    scene = scenario_of(scenario, keywords).scene
    teams = int(teams_of([seat.team for seat in scene.seats]).max()) + 1
    rows = np.arange(1, len(opponents) + 1).repeat(games)
    lineups = rows[:, None].repeat(teams, axis=1)
    lineups[np.arange(len(rows)), np.arange(len(rows)) % teams] = 0
    results = play_games(scenario, [player, *opponents], lineups, seed, keywords)
    score, margin = results.score[lineups == 0], results.margin[lineups == 0]
    return score.reshape(-1, games).mean(-1), margin.reshape(-1, games).mean(-1)


def play_games(
    scenario: str,
    players: Sequence[Driver],
    lineups: Array,
    seed: int,
    keywords: Keywords | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> GameResults:
    """Play G games to their ends in one batch.

    Args:
        scenario: Name of a game.
        players: Drivers of the players.
        lineups: Index of the player of each team in each game, (G, T).
        seed: Seed of the first game; game i has the seed ``seed + i``.
        keywords: Keywords of the environment, see `build_world`.
        report: Function that is called after every control step with the finished share
            of the longest possible game.

    Raises:
        ValueError: The scenario has no teams that play against each other.
    """
    games = len(lineups)
    forms = [player.observe for player in players if player.observe]
    world = build_world(scenario, games, False, keywords or {}, forms)
    teams = teams_of([seat.team for seat in world.scene.seats])
    if teams.max() == 0:
        together = len(teams) > 1
        instead = (
            f"airhockey crossplay {scenario}" if together else "airhockey evaluate"
        )
        raise ValueError(
            f"{scenario!r} has no teams that play against each other; use {instead}"
        )
    if lineups.shape != (games, teams.max() + 1):
        raise ValueError(f"lineups: {scenario!r} needs {teams.max() + 1} teams")
    roster = Roster(world)
    for number, player in enumerate(players):
        roster.add(f"player {number}", player)
    roster.seated[:] = np.asarray(lineups)[:, teams]
    world.reset(seed)
    roster.begin(np.arange(games))
    first = [int(np.flatnonzero(teams == team)[0]) for team in range(teams.max() + 1)]
    won, margin = np.zeros(lineups.shape, np.bool_), np.zeros(lineups.shape)
    lasted = np.full(lineups.shape, np.inf)
    seconds = np.zeros(games)
    for number, step in enumerate(play(world, roster.ask), 1):
        eliminated, now = world.eliminated, world.state.time[:, None]
        if eliminated is not None:
            out = np.stack(
                [eliminated[:, teams == t].all(-1) for t in np.unique(teams)], 1
            )
            out &= step.live[:, None]
            lasted = np.where(out, np.minimum(lasted, now), lasted)
        ended = step.ended
        won[ended] = world.episode.success[ended][:, first]
        margin[ended] = world.episode.returns[ended][:, first]
        seconds[ended] = world.state.time[ended]
        report(number / world.max_cycles)
    world.close()
    return GameResults(won, margin, lasted, seconds)
