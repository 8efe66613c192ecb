"""Learning against others and earlier selves."""

import numpy as np
import pytest
from runs import SMALL, rows

import marl_airhockey as ah
from marl_airhockey.evaluation.league import find_policies
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.self_play import make_training_env
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy

GAME = {**SMALL, "num_worlds": 32, "batch_size": 256, "n_steps": 16, "snapshots": 4}
GAME |= {
    "options": {"seconds": 3.0},
    "eval_episodes": 4,
    "pool": 2,
    "self_play_fraction": 0.5,
}
GAME |= {"total_steps": 6144, "opponents": ["random", "goalkeeper"]}


def training_env(folder, **changes):
    config = preset("doubles", {**GAME, **changes})
    return config, make_training_env(config, config.num_worlds, folder)


def test_learners_and_opponents_share_an_environment(tmp_path):
    _, env = training_env(tmp_path)
    assert env.num_envs == 16 * 4 + 16 * 2
    env.seed(0)
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
            env.world.sensed, env.world.known.memory, np.arange(4)
        )
        np.testing.assert_array_equal(seen, world[env._rows, env._seats])
        actions = rng.uniform(-1, 1, (env.num_envs, 2)).astype(np.float32)
        seen, reward, done, infos = env.step(actions)
        for i in np.flatnonzero(done):
            assert infos[i]["terminal_observation"].shape == seen[i].shape
        assert reward.shape == done.shape == (env.num_envs,)
    assert set(env.scores) == {"random", "goalkeeper"}
    assert env.scores["random"] != 0.5


def test_opponents_move_slower_in_half_of_the_games_that_do_not_count(tmp_path):
    alone = {"self_play_fraction": 0.0, "scripted_fraction": 1.0, "num_worlds": 64}
    _, env = training_env(
        tmp_path, opponents=["random"], opponent_speed_range=[0.2, 1.0], **alone
    )
    env.reset()
    pace = env._pace.copy()
    assert 16 < (pace == 1.0).sum() < 48
    assert (pace >= 0.2).all()
    assert pace.min() < 0.4
    idle = np.zeros((env.num_envs, 2))
    most = np.zeros(64)
    for _ in range(20):
        theirs = env._roster.seated >= 0
        env.step(idle)
        given = env.world.requested
        most = np.maximum(most, np.abs(given * theirs[..., None]).max((1, 2)))
        assert not given[~theirs].any()
    assert (most <= pace).all()
    assert (most > 0.7 * pace).all()
    # Only worlds whose opponents play at full pace change the score.
    last = env.world.step(np.zeros((64, 4, 2)))
    last.success[:], before = False, env._scores.copy()
    env._pace[:] = 0.5
    env._restarted(np.arange(64), last)
    np.testing.assert_array_equal(env._scores, before)
    env._pace[:] = 1.0
    last.success[np.arange(64)[:, None], env._members[env._learner]] = True
    env._restarted(np.arange(64), last)
    assert (env._scores > before).all()


def test_hard_opponents_come_more_often(tmp_path):
    _, env = training_env(tmp_path, opponents=["random", "goalkeeper"])
    env._scores[:] = 0.95, 0.2
    drawn = np.bincount(env._draw(4000), minlength=2) / 4000
    assert drawn[1] > 0.9


def test_self_play_trains_resumes_and_keeps_its_past(tmp_path):
    folder = tmp_path / "run"
    config = preset("duel", GAME)
    assert config.self_play
    last = run_training(config, folder)
    assert set(last) >= {"score", "score/random", "return"}
    assert len(rows(folder)) >= 2
    assert len(list((folder / "pool").glob("*.npz"))) == 2
    past = sorted((folder / "checkpoints").glob("*.npz"))
    assert len(past) >= 2
    policy, old = load_policy(folder / "last.npz"), load_policy(past[-1])
    world = ah.make_world("duel", 8, backend="numba")
    seen = world.reset(0)[:, 0]
    same = policy.predict(seen, True), old.predict(seen, True)
    np.testing.assert_allclose(*(np.clip(x, -1, 1) for x in same), atol=1e-5)
    text = (folder / "config.toml").read_text().replace("= 6144", "= 9216")
    (folder / "config.toml").write_text(text)
    assert run_training(None, folder)["steps"] > last["steps"]
    assert find_policies(tmp_path) == [folder]


def test_exploiters_train_against_the_learner_and_join_its_opponents(tmp_path):
    folder = tmp_path / "run"
    config = preset("duel", {**GAME, "exploiters": 2, "pool": 8})
    run_training(config, folder)
    assert len(list(folder.glob("pool/*-exploiter.npz"))) == 2
    assert len(list(folder.glob("exploiters/*.npz"))) == 2, "counted when resumed"
    for number in (1, 2):
        run = folder / "exploiters" / str(number)
        learner = run / "learner" / "last.npz"
        (row,) = rows(run)
        assert int(float(row["steps"])) >= config.total_steps / 6
        assert f"score/{learner}" in row, "it plays against the learner only"
        weights = [
            load_policy(path).predict.layers[0][0]
            for path in (learner, run / "last.npz")
        ]
        assert np.abs(weights[0] - weights[1]).max() > 0.0
        # It begins with the weights of the learner.
        assert np.abs(weights[0] - weights[1]).max() < 0.3
    assert preset("duel", {"engine": "sb3"}).exploiters == 0
    assert preset("duel", {"drivers": {"paddle_1": "striker"}}).exploiters == 0
    with pytest.raises(ValueError, match="exploiters: only games"):
        preset("duel", {"engine": "sb3", "exploiters": 2})
    with pytest.raises(ValueError, match="exploiters: only games"):
        preset("reach", {"exploiters": 2})
