"""How much a player can be exploited: a best response, trained for a fixed budget."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marl_airhockey.evaluation.games import play
from marl_airhockey.learn.config import preset
from marl_airhockey.learn.train import train
from marl_airhockey.registry import make_agent, make_scenario
from marl_airhockey.toolkit.policies import load_policy

GAMES = 400
SEED = 4_000_000


def best_response(
    scenario: str, player: str, steps: int, folder: Path, seed: int = 0
) -> float:
    """Learn against a player that stays as it is, and play it.

    Args:
        scenario: a game of two teams.
        player: a driver's name or a policy's path.
        steps: of single worlds.
        folder: of the run; if there is one already, it is not trained again.
        seed: of worlds and network.

    Returns:
        The response's score, a draw being half a win: 0.5 if nothing better than the
        player was found.
    """
    seats = make_scenario(scenario).scene.seats
    foes = [i for i, seat in enumerate(seats) if seat.team != seats[0].team]
    drivers = {f"paddle_{i}": player for i in foes}
    if not (folder / "last.zip").exists():
        changes = {"drivers": drivers, "total_steps": steps, "seed": seed}
        train(preset(scenario, {**changes, "evaluations": 4}), folder)
    lineups = np.array([[0, 1], [1, 0]]).repeat(GAMES // 2, axis=0)
    response = load_policy(folder / "last.zip")
    found = play(
        scenario,
        [response, make_agent(player)],
        lineups,
        SEED,
        {"backend": "numba"},
    )
    return float(found.score[lineups == 0].mean())
