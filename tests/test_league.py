"""Players against each other: rosters, games, ratings, self-play, statistics."""

import json

import numpy as np
import pytest
from test_learn import SMALL, rows

import marl_airhockey as ah
from marl_airhockey.evaluation.games import play_games
from marl_airhockey.evaluation.league import find_policies, play_league
from marl_airhockey.evaluation.stats import (
    bootstrap,
    elo,
    iqm,
    probability_of_improvement,
)
from marl_airhockey.learn.best_response import best_response
from marl_airhockey.learn.config import preset
from marl_airhockey.learn.sb3 import build_model
from marl_airhockey.learn.self_play import make_training_env
from marl_airhockey.learn.train import train
from marl_airhockey.registry import make_agent
from marl_airhockey.toolkit.numpy_policy import NumpyPolicy
from marl_airhockey.toolkit.policies import load_policy
from marl_airhockey.world.roster import Roster

SHORT = {"options": {"seconds": 6.0}, "backend": "numba"}


def test_a_roster_plays_as_drivers_inside_do():
    names = ["striker", "goalkeeper"]
    inside = dict(zip(("paddle_0", "paddle_1"), names, strict=True))
    one = ah.make_world("duel", 6, backend="numba", drivers=inside)
    two = ah.make_world("duel", 6, backend="numba")
    roster = Roster(two)
    for name in names:
        roster.add(name, make_agent(name))
    roster.seated[:] = [0, 1]
    one.autoreset = two.autoreset = False
    one.reset(3)
    two.reset(3)
    roster.begin(np.arange(6))
    actions = np.zeros((6, 2, 2))
    for _ in range(80):
        roster.ask(actions)
        one.step(np.zeros((6, 0, 2)))
        two.step(actions)
    np.testing.assert_allclose(one.state.position, two.state.position, atol=1e-12)


def test_who_sits_where_differs_by_world():
    world = ah.make_world("duel", 4, backend="numba")
    roster = Roster(world)
    still, random = (roster.add(n, make_agent(n)) for n in ("still", "random"))
    roster.seated[:] = [[still, random], [random, still], [-1, random], [-1, -1]]
    world.reset(0)
    roster.begin(np.arange(4))
    actions = np.full((4, 2, 2), 9.0)
    roster.ask(actions)
    assert not actions[[0, 1], [0, 1]].any()
    assert (actions[[2, 3, 3], [0, 0, 1]] == 9.0).all()
    action = actions[[0, 1, 2], [1, 0, 1]]
    assert (np.abs(action) <= 1).all()
    assert len(np.unique(action)) == 6


def test_games_have_a_winner_or_none_and_ends_do_not_matter():
    players = [make_agent("allround"), make_agent("random")]
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


def test_ratings_follow_the_model_they_come_from():
    true = np.array([1200.0, 1000.0, 800.0])
    share = 1 / (1 + 10 ** (-np.subtract.outer(true, true) / 400))
    games = 4000.0 * (1 - np.eye(3))
    np.testing.assert_allclose(elo(share * games, games), true, atol=1.0)
    alone = elo(np.array([[0.0, 10.0], [0.0, 0.0]]), np.array([[0, 10.0], [10.0, 0]]))
    assert np.isfinite(alone).all()


def test_statistics_of_runs():
    assert iqm(np.array([-100.0, 1.0, 2.0, 3.0, 4.0, 100.0, 2.5, 2.5])) == 2.5
    assert iqm(np.arange(5)) == pytest.approx(2.0)
    low, high = bootstrap(np.random.default_rng(0).normal(5.0, 1.0, 200))
    assert low < 5.0 < high
    assert high - low < 0.5
    assert bootstrap(np.ones(4)) == (1.0, 1.0)
    assert probability_of_improvement([1, 2, 3], [0, 0, 0]) == 1.0
    assert probability_of_improvement([1, 2], [1, 2]) == 0.5
    with pytest.raises(ValueError, match="no values"):
        iqm(np.array([]))


GAME = {**SMALL, "num_worlds": 32, "batch_size": 256, "n_steps": 16, "snapshots": 4}
GAME |= {"options": {"seconds": 3.0}, "eval_episodes": 4, "pool": 2, "mirror": 0.5}
GAME |= {"total_steps": 6144, "opponents": ["random", "goalkeeper"]}


def training_env(folder, **changes):
    config = preset("doubles", {**GAME, **changes})
    return config, make_training_env(config, config.num_worlds, folder)


def test_learners_and_opponents_share_an_environment(tmp_path):
    _, env = training_env(tmp_path)
    assert env.num_envs == 16 * 4 + 16 * 2
    seen = env.reset()
    assert seen.shape == (env.num_envs, env.observation_space.shape[0])
    seated = env._roster.seated
    assert (seated[:16] == -1).all()
    assert ((seated[16:] == -1).sum(-1) == 2).all(), "a team of the learner's"
    sides = [set(np.flatnonzero(row == -1)) for row in seated[16:]]
    assert {0, 1} in sides
    assert {2, 3} in sides
    rng = np.random.default_rng(0)
    for _ in range(130):
        world = env.world.observer.read(
            env.world.sensed, env.world.memory, np.arange(4)
        )
        np.testing.assert_array_equal(seen, world[env._rows, env._seats])
        actions = rng.uniform(-1, 1, (env.num_envs, 2)).astype(np.float32)
        seen, reward, done, infos = env.step(actions)
        for i in np.flatnonzero(done):
            assert infos[i]["terminal_observation"].shape == seen[i].shape
        assert reward.shape == done.shape == (env.num_envs,)
    assert set(env.scores) == {"random", "goalkeeper"}
    assert env.scores["random"] != 0.5


def test_hard_opponents_come_more_often(tmp_path):
    _, env = training_env(tmp_path, opponents=["random", "goalkeeper"])
    env._scores[:] = 0.95, 0.2
    drawn = np.bincount(env._draw(4000), minlength=2) / 4000
    assert drawn[1] > 0.9


def test_self_play_trains_resumes_and_keeps_its_past(tmp_path):
    folder = tmp_path / "run"
    config = preset("duel", GAME)
    assert config.self_play
    last = train(config, folder)
    assert set(last) >= {"score", "score/random", "return"}
    assert len(rows(folder)) >= 2
    assert len(list((folder / "pool").glob("*.npz"))) == 2
    past = sorted((folder / "checkpoints").glob("*.npz"))
    assert len(past) >= 2
    policy, old = load_policy(folder / "last.zip"), load_policy(past[-1])
    world = ah.make_world("duel", 8, backend="numba")
    seen = world.reset(0)[:, 0]
    same = policy.predict(seen, True), old.predict(seen, True)
    np.testing.assert_allclose(*(np.clip(x, -1, 1) for x in same), atol=1e-5)
    text = (folder / "config.toml").read_text().replace("= 6144", "= 9216")
    (folder / "config.toml").write_text(text)
    assert train(None, folder)["steps"] > last["steps"]
    assert find_policies(tmp_path) == [str(folder)]


def test_a_frozen_policy_is_one_small_file(tmp_path):
    config = preset("reach", SMALL)
    env = ah.make_sb3_vec("reach", 32, backend="numba")
    from marl_airhockey.learn.network import to_numpy
    from marl_airhockey.learn.sb3_callback import AdaptiveRate

    model = build_model(config, env, AdaptiveRate(config, 1e-3))
    to_numpy(model, {"scenario": "reach"}).save(tmp_path / "policy.npz")
    assert (tmp_path / "policy.npz").stat().st_size < 300_000
    driver = make_agent(tmp_path / "policy.npz")
    seen = env.reset()
    mean = model.predict(seen, deterministic=True)[0]
    np.testing.assert_allclose(
        np.clip(driver.predict(seen, True), -1, 1), mean, atol=1e-5
    )
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="no policy of ours"):
        NumpyPolicy.load(tmp_path / "bad.npz")


def test_a_best_response_is_learned_against_one_player(tmp_path):
    score = best_response("duel", "still", 4096 * 8, tmp_path / "response")
    assert 0.0 <= score <= 1.0
    assert best_response("duel", "still", 1, tmp_path / "response") == score
