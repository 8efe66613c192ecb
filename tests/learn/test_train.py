"""Evaluation, leagues and training as calls from Python."""

import numpy as np
import pytest
from runs import SMALL

import marl_airhockey as ah


def test_any_player_is_evaluated():
    still = ah.evaluate("still", "juggle", episodes=20)
    lazy = ah.evaluate(lambda seen: np.zeros((len(seen), 2)), "juggle", episodes=20)
    assert (still.driver, still.backend, still.episodes) == ("still", "numba", 20)
    assert lazy.driver == "<lambda>"
    assert lazy.returns == still.returns
    with pytest.raises(TypeError, match="unexpected keyword argument 'episode'"):
        ah.evaluate("still", "juggle", episode=20)


def test_any_players_meet_in_a_league():
    players = {"script": "allround", "mine": lambda seen: np.ones((len(seen), 2))}
    standings = ah.league("duel", players, games=10, options={"seconds": 10.0})
    assert standings.names == ("script", "mine")
    assert ah.league("duel", ["still", "random"], games=2).names == ("still", "random")


def test_a_run_gives_a_player(tmp_path):
    seen = []
    result = ah.train(
        "reach", tmp_path / "run", report=lambda *row: seen.append(row), **SMALL
    )
    assert result.steps >= SMALL["total_steps"]
    assert seen
    assert 0 <= result.metrics["success"] <= 1
    again = ah.evaluate(result.folder, "reach", episodes=20)
    assert ah.evaluate(result.policy(), "reach", episodes=20).returns == again.returns
