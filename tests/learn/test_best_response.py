"""Learning against one player."""

import pytest

from marl_airhockey.learn.best_response import best_response


@pytest.mark.slow
def test_a_best_response_is_learned_against_one_player(tmp_path):
    score = best_response("duel", "still", 4096 * 8, tmp_path / "response")
    assert 0.0 <= score <= 1.0
    assert best_response("duel", "still", 1, tmp_path / "response") == score
