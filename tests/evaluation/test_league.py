"""Leagues: everybody against everybody, rated and written down."""

import json

import numpy as np
import pytest

from marl_airhockey.evaluation.league import play_league
from marl_airhockey.registry import make_agent

SHORT = {"options": {"seconds": 6.0}, "backend": "numba"}


def test_a_league_rates_and_names_its_files(tmp_path):
    names = ("random", "allround", "striker:strength=weak", "still")
    players = {name: make_agent(name) for name in names}
    standings = play_league("duel", players, 20, keywords=SHORT)
    off = ~np.eye(4, dtype=bool)
    np.testing.assert_allclose((standings.score + standings.score.T)[off], 1.0)
    np.testing.assert_allclose(standings.margin, -standings.margin.T)
    assert standings.names[standings.order[0]] == "allround"
    low, high = standings.rating_intervals.T
    assert ((low <= standings.ratings) & (standings.ratings <= high)).all()
    assert (high - low > 1.0).all()
    files = standings.save(tmp_path)
    assert [f.name for f in files] == ["league.json", "league.md", "league.png"]
    report = json.loads(files[0].read_text())
    assert report["players"][0] == report["table"][0]["player"] == "allround"
    assert "| allround |" in files[1].read_text()
    with pytest.raises(ValueError, match="two players"):
        play_league("duel", {"still": players["still"]}, 2)


def test_a_circle_is_named():
    standings = play_league("duel", {n: make_agent(n) for n in ("still", "random")}, 2)
    wins = np.array([[0, 90, 5], [5, 0, 90], [90, 5, 0]])
    three = type(standings)(
        "duel", ("a", "b", "c"), 100, wins, np.full((3, 3), 5), *np.zeros((3, 3, 3))
    )
    assert three.circles == [("a", "b", "c")]
