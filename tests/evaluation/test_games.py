"""Games of players against each other."""

import numpy as np
import pytest

from marl_airhockey.evaluation.games import play_games
from marl_airhockey.registry import make_driver


def test_games_have_a_winner_or_none_and_ends_do_not_matter():
    players = [make_driver("allround"), make_driver("random")]
    lineups = np.array([[0, 1]] * 20 + [[1, 0]] * 20)
    found = play_games("duel", players, lineups, 0, {"backend": "numba"})
    np.testing.assert_allclose(found.score.sum(-1), 1.0)
    np.testing.assert_allclose(found.margin.sum(-1), 0.0)
    mine = found.score[lineups == 0]
    assert mine[:20].mean() > 0.9
    assert mine[20:].mean() > 0.9
    assert (found.seconds <= 60.0 + 1e-6).all()
    everybody = np.array([[0, 1, 1, 1]] * 12)
    crowd = play_games("free_for_all", players, everybody, 0, {"backend": "numba"})
    assert crowd.won[:, 0].mean() > 0.5
    with pytest.raises(ValueError, match="no teams"):
        play_games("rally", players, lineups, 0)
