"""Play with mates that a player was not trained with."""

import numpy as np
import pytest

from marl_airhockey.evaluation.crossplay import CrossPlay, play_together
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.registry import make_agent

SHORT = {"options": {"seconds": 8.0}}


def players(*names):
    return {name: make_agent(name) for name in names}


def test_the_gap_is_what_players_lose_with_others():
    returns = np.array([[10.0, 4.0, 4.0], [6.0, 8.0, 6.0], [2.0, 0.0, 6.0]])
    found = CrossPlay("rally", ("a", "b", "c"), 5, returns, np.zeros((3, 3)))
    assert found.self_play == 8.0
    assert found.cross_play == pytest.approx(22.0 / 6.0)
    np.testing.assert_allclose(found.gaps, [6.0, 4.0, 3.0])
    assert found.gaps.mean() == pytest.approx(found.self_play - found.cross_play)
    low, high = found.gap_interval
    assert 3.0 <= low < found.gaps.mean() < high <= 6.0
    assert found.to_json()["gap"] == pytest.approx(13.0 / 3.0)


def test_every_player_meets_every_other_in_both_roles():
    found = play_together("rally", players("allround", "still"), 8, 3, SHORT)
    assert found.returns[0, 0] > found.returns[1, 1] == 0.0
    one, mate = make_agent("still"), {"drivers": {"paddle_1": "allround"}}
    alone = evaluate(one, "rally", episodes=8, seed=3, **{**SHORT, **mate})
    assert found.returns[1, 0] == alone.returns
    assert found.to_json()["players"] == ["allround", "still"]


def test_in_doubles_mates_are_drawn_and_opponents_given():
    rivals = {"drivers": {"paddle_2": "still", "paddle_3": "still"}}
    found = play_together(
        "doubles", players("allround", "still"), 4, 3, {**SHORT, **rivals}
    )
    assert found.returns[0, 0] > 0.0
    with pytest.raises(ValueError, match="paddle_2"):
        play_together("doubles", players("allround", "still"), 4, 3, SHORT)


def test_what_cannot_be_played_is_named():
    with pytest.raises(ValueError, match="two players"):
        play_together("rally", players("still"))
    with pytest.raises(ValueError, match="'duel' has no team of two"):
        play_together("duel", players("still", "allround"))
