"""Play with teammates that a player was not trained with."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.evaluation.crossplay import CrossPlay
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.registry import make_driver

SHORT = {"options": {"seconds": 8.0}}


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
    found = ah.crossplay("rally", ["allround", "still"], episodes=8, seed=3, **SHORT)
    assert found.returns[0, 0] > found.returns[1, 1] == 0.0
    one, teammate = make_driver("still"), {"drivers": {"paddle_1": "allround"}}
    alone = evaluate(one, "rally", episodes=8, seed=3, **{**SHORT, **teammate})
    assert found.returns[1, 0] == alone.returns
    assert found.to_json()["players"] == ["allround", "still"]


def test_in_doubles_mates_are_drawn_and_opponents_given():
    opponents = {"drivers": {"paddle_2": "still", "paddle_3": "still"}}
    names, given = ["allround", "still"], {"episodes": 4, "seed": 3, **SHORT}
    found = ah.crossplay("doubles", names, **given, **opponents)
    assert found.returns[0, 0] > 0.0
    with pytest.raises(ValueError, match="paddle_2"):
        ah.crossplay("doubles", names, **given)


def test_policies_of_the_zoo_play_as_they_were_trained():
    found = ah.crossplay(
        "rally", {"learned": "zoo/rally", "script": "allround"}, episodes=8
    )
    assert found.names == ("learned", "script")
    assert found.success[0, 0] > 0.5


def test_what_cannot_be_played_is_named():
    with pytest.raises(ValueError, match="expected a list of names"):
        ah.crossplay("rally", "still")
    with pytest.raises(ValueError, match="two players"):
        ah.crossplay("rally", ["still"])
    with pytest.raises(ValueError, match="'duel' has no team of two"):
        ah.crossplay("duel", ["still", "allround"])
