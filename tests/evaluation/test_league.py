"""Leagues: everybody against everybody, rated and written down."""

import json

import numpy as np
import pytest

from marl_airhockey.evaluation.games import GameResults
from marl_airhockey.evaluation.league import compared, league, lineups_of
from marl_airhockey.evaluation.stats import elo, nash_mixture
from marl_airhockey.registry import make_driver

SHORT = {"options": {"seconds": 6.0}, "backend": "numba"}


def test_a_league_rates_and_names_its_files(tmp_path):
    names = ("random", "allround", "striker:strength=weak", "still")
    players = {name: make_driver(name) for name in names}
    standings = league("duel", players, games=20, **SHORT)
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
        league("duel", {"still": players["still"]}, games=2)


def test_a_cycle_is_named():
    standings = league("duel", ("still", "random"), games=2)
    wins = np.array([[0, 90, 5], [5, 0, 90], [90, 5, 0]])
    three = type(standings)(
        "duel", ("a", "b", "c"), 100, wins, np.full((3, 3), 5), *np.zeros((3, 3, 3))
    )
    assert three.cycles == [("a", "b", "c")]


def test_places_are_of_winners_then_of_who_was_out_later_then_of_margins():
    inf = np.inf
    results = GameResults(
        won=np.array([[False, True, False, False]]),
        margin=np.array([[1.0, 2.0, 5.0, 1.0]]),
        lasted=np.array([[20.0, inf, 10.0, 20.0]]),
        seconds=np.array([30.0]),
    )
    # The second won; the first and the last, out at once with one margin, share.
    beaten_by = results.ahead[0].sum(0)
    assert beaten_by.tolist() == [1, 0, 3, 1]
    wins, draws, margin = compared(results, np.array([[3, 0, 1, 1]]), 4)
    assert wins[0].tolist() == [0, 2, 0, 1]
    assert wins[3].tolist() == [0, 1, 0, 0]
    assert draws[3, 1] == draws[1, 3] == 1
    assert margin[0, 1] == 2.0
    assert margin[1, 3] == 3.0


@pytest.mark.parametrize(("players", "sides"), [(7, 4), (4, 4), (9, 3), (2, 4), (5, 2)])
def test_lineups_let_all_pairs_meet_alike(players, sides):
    lineups = lineups_of(players, sides, 20, 0)
    met = np.zeros((players, players))
    for row in lineups:
        assert len(set(row)) == min(sides, players)
        for a in set(row):
            for b in set(row) - {a}:
                met[a, b] += 1
    off = met[~np.eye(players, dtype=bool)]
    assert off.mean() == pytest.approx(20, abs=1.0)
    assert off.max() - off.min() <= 4
    seats = np.stack([np.bincount(c, minlength=players) for c in lineups.T])
    assert seats.max() < 2.0 * seats.mean()


def test_a_league_of_four_sides_rates_by_places(tmp_path):
    names = ("still", "random", "goalkeeper", "allround", "striker")
    players = {name: make_driver(name) for name in names}
    short = {"options": {"seconds": 15.0, "lives": 1}}
    standings = league("free_for_all", players, games=24, **short)
    assert standings.played.sum() > 0
    ranked = [names[i] for i in standings.order]
    assert set(ranked[:3]) == {"goalkeeper", "allround", "striker"}
    text = standings.save(tmp_path)[1].read_text()
    assert "Nash share" in text
    report = json.loads((tmp_path / "league.json").read_text())
    low, high = np.moveaxis(np.array(report["score_intervals"], float), -1, 0)
    score = np.array(report["score"], float)
    off = ~np.eye(5, dtype=bool)
    assert ((low <= score) & (score <= high))[off].all()


def test_ratings_by_places_are_those_of_a_plackett_luce_model():
    # Places drawn from known ratings: who is best leaves first, and so on.
    rng, true = np.random.default_rng(0), np.array([1300.0, 1100.0, 900.0, 700.0])
    noise = rng.gumbel(size=(6000, 4)) + np.log(10) * true / 400.0
    margin = noise.argsort(-1).argsort(-1).astype(float)
    nobody = np.zeros((6000, 4), np.bool_)
    results = GameResults(nobody, margin, np.full((6000, 4), np.inf), np.ones(6000))
    lineups = np.tile(np.arange(4), (6000, 1))
    wins, draws, _ = compared(results, lineups, 4)
    found = elo(wins + 0.5 * draws, wins + wins.T + draws)
    np.testing.assert_allclose(found, true, atol=15.0)


def test_nobody_beats_the_mixture():
    circle = np.array([[0.5, 0.8, 0.2], [0.2, 0.5, 0.8], [0.8, 0.2, 0.5]])
    np.testing.assert_allclose(nash_mixture(circle), 1 / 3, atol=1e-6)
    ladder = np.array([[0.5, 0.7, 0.9], [0.3, 0.5, 0.7], [0.1, 0.3, 0.5]])
    assert nash_mixture(ladder).tolist() == [1.0, 0.0, 0.0]
    # A copy of a player shares its part.
    rows = [0, 1, 2, 2]
    shares = nash_mixture(circle[np.ix_(rows, rows)])
    np.testing.assert_allclose(shares, [1 / 3, 1 / 3, 1 / 6, 1 / 6], atol=4e-3)
    assert shares[2] == shares[3]
    rng = np.random.default_rng(1)
    edge = rng.uniform(-0.5, 0.5, (6, 6))
    score = 0.5 + np.triu(edge, 1) - np.triu(edge, 1).T
    assert (score @ nash_mixture(score)).max() < 0.53
