"""Suites of set pieces: what is published, what begins, and what is compared."""

from dataclasses import replace

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test

import marl_airhockey as ah
from marl_airhockey.evaluation.suites import pieces as module
from marl_airhockey.evaluation.suites.pieces import (
    CLASSES,
    Pieces,
    load_pieces,
    suite_names,
)
from marl_airhockey.evaluation.suites.solution import Solution
from marl_airhockey.evaluation.suites.suite import PairedDifference, load_suite

SUITES = suite_names()


@pytest.fixture
def own(tmp_path):
    """Save pieces under the name of a test and return the path."""

    def save(pieces):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.npz"
        pieces.save(path)
        return str(path)

    return save


@pytest.fixture(scope="module")
def some():
    """Twelve pieces of defence."""
    return load_pieces("defence-v1").select(np.arange(12))


@pytest.mark.parametrize("name", SUITES)
def test_a_suite_is_solved_by_its_solutions_and_never_by_rest(name):
    suite = load_suite(name)
    assert len(suite) == 1000
    classes = suite.pieces.difficulty.astype(int)
    assert np.bincount(classes)[1:].tolist() == [200] * CLASSES
    assert suite.play(Solution(name)).solved.all()
    still = suite.play("still")
    assert not still.solved.any()
    assert np.mean([suite.play("random", k).solved for k in (7, 8)]) < 0.2


@pytest.mark.parametrize("name", SUITES)
def test_a_published_file_is_the_one_that_is_saved_again(name, tmp_path):
    load_pieces(name).save(tmp_path / "again.npz")
    again = (tmp_path / "again.npz").read_bytes()
    assert again == (module.FOLDER / f"{name}.npz").read_bytes()


def test_environments_begin_with_the_pieces_in_turn():
    suite = load_suite("defence-v1")
    env = ah.gym_env(suite.scenario, drivers=suite.drivers)
    for seed, number in ((0, 0), (5, 5), (None, 6), (1003, 3)):
        env.reset(seed=seed)
        piece = list(suite)[number]
        state, _ = env.get_state()
        np.testing.assert_array_equal(state.position[:3], piece.position)
        np.testing.assert_array_equal(state.velocity[:3], piece.velocity)
    many = ah.make_vec(suite.scenario, 3, drivers=suite.drivers)
    first, _ = many.reset(seed=5)
    one, _ = env.reset(seed=7)
    np.testing.assert_array_equal(first[2], one)
    parallel_api_test(ah.parallel_env(suite.scenario), num_cycles=60)


def test_one_seat_wins_what_the_other_loses():
    world = ah.make_world(load_suite("attack-v1").scenario, 32)
    world.reset(0)
    rng, ends = np.random.default_rng(0), 0
    for _ in range(100):
        step = world.step(rng.uniform(-1, 1, (32, 2, 2)))
        ended = step.terminated | step.truncated
        assert (np.abs(step.reward[ended]) == 1.0).all()
        assert not step.reward[~ended].any()
        np.testing.assert_array_equal(step.reward.sum(-1), 0.0)
        ends += ended.sum()
    assert ends > 32


def test_a_hidden_puck_is_observed_where_it_was_seen_last(some, own):
    hidden = np.tile([0.1, 0.3], (len(some), 1))
    suites = [load_suite(own(replace(some, hidden=h))) for h in (hidden, 0 * hidden)]
    blind, clear = (
        ah.make_world(s.scenario, len(some), drivers={"paddle_1": "still"})
        for s in suites
    )
    seen = [[w.reset(0)] for w in (blind, clear)]
    for _ in range(12):
        for world, shown in zip((blind, clear), seen, strict=True):
            world.autoreset = False
            shown.append(world.step(np.zeros((len(some), 1, 2))).observation)
    seen = np.array(seen)[:, :, :, 0]
    puck = [blind.observer.layout.labels.index(f"puck_0.{a}") for a in "xy"]
    at, true = seen[0][..., puck], seen[1][..., puck]
    # Observations are 3 steps old, and the last visible puck is that after 1 step. The
    # movement before the start is observed at first.
    np.testing.assert_array_equal(at[:5], true[:5])
    for step in range(5, 9):
        np.testing.assert_array_equal(at[step], true[4])
    np.testing.assert_array_equal(at[9:], true[9:])
    assert (true[5:9] != true[4]).any()
    velocity = some.velocity[:, 2]
    np.testing.assert_allclose(
        true[0], some.position[:, 2] - 0.15 * velocity, atol=1e-6
    )
    np.testing.assert_allclose(true[3], some.position[:, 2], atol=1e-6)
    shown = load_suite(suites[0].name, hide=False)
    assert not shown.scenario.hides


def test_paired_drivers_are_told_apart_by_the_pieces_that_only_one_solves():
    first, second = np.zeros((2, 100), bool)
    first[:10], second[10:12] = True, True
    both = np.zeros(100, bool)
    both[50:90] = True
    found = PairedDifference.of(first | both, second | both)
    assert (found.only_first, found.only_second) == (10, 2)
    assert found.p_value == pytest.approx(2 * (1 + 12 + 66) / 2**12)
    assert PairedDifference.of(both, both).p_value == 1.0


def test_a_driver_is_summarized_by_class():
    suite = load_suite("attack-v1")
    result = suite.summarize("striker", suite.play("striker"))
    assert result.success == pytest.approx(np.mean(result.by_class))
    low, high = result.success_interval
    assert low < result.success < high
    assert 0.5 < result.touched <= 1.0
    assert 0.0 < result.first_touch < 4.0


def test_pieces_run_on_pymunk(some, own):
    suite = load_suite(own(some))
    assert not suite.play("still", backend="pymunk").solved.any()
    keeper = [suite.play("goalkeeper", backend=b) for b in ("numba", "pymunk")]
    assert (keeper[0].solved == keeper[1].solved).mean() > 0.7


def test_a_suite_file_is_read_again(some, tmp_path):
    path = tmp_path / "mine.npz"
    some.save(path)
    assert len(load_suite(path)) == 12
    few = some.select(some.difficulty == some.difficulty[0])
    few.save(path)
    suite = load_suite(path)
    assert len(suite) == len(few) < 12
    result = suite.summarize("still", suite.play("still"))
    assert result.by_class.count(None) == CLASSES - 1
    with pytest.raises(ValueError, match="pieces were played"):
        suite.summarize("still", load_suite("defence-v1").play("still"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"reacton": 0.3}, "reacton"),
        ({"suite": "x"}, "the first argument is the suite"),
        ({"seconds": 1.0}, "the pieces of defence-v1 last 2 s"),
        ({"pucks": 2}, "pieces have 1"),
        ({"reaction": 0.07}, "not a multiple of control_dt"),
        ({"seats": "robot"}, "outside its workspace|outside the workspace"),
    ],
)
def test_options_that_do_not_fit_are_named(words, message):
    with pytest.raises(ValueError, match=message):
        load_suite("defence-v1", **words).play("still")


@pytest.mark.parametrize(
    ("player", "keywords", "message"),
    [
        ("mouse", {}, "needs a person or a device"),
        ("gamepad", {}, "needs a person or a device"),
        ("reacher", {}, "has no goal"),
        ("zoo/juggle", {}, "expects observations of shape"),
        ("still", {"max_cycles": 3}, "max_cycles: the suite has its own"),
        (
            "still",
            {"drivers": {"paddle_1": "striker"}},
            "drivers: the suite has its own",
        ),
        ("still", {"backend": "robosuite"}, "use numba or pymunk"),
        ("still", {"backend": "real"}, "use numba or pymunk"),
    ],
)
def test_drivers_and_keywords_that_do_not_fit_are_named(player, keywords, message):
    with pytest.raises(ValueError, match=message):
        load_suite("defence-v1").play(player, **keywords)


def test_what_is_wrong_with_a_suite_is_named(some, own, tmp_path, monkeypatch):
    with pytest.raises(
        ValueError, match="unknown suite 'defense-v1'; there are: defence-v1"
    ):
        load_suite("defense-v1")
    with pytest.raises(ValueError, match="there is no such file"):
        load_suite(str(tmp_path / "none.npz"))
    (tmp_path / "text.npz").write_text("text")
    with pytest.raises(ValueError, match="not a suite of set pieces"):
        load_suite(str(tmp_path / "text.npz"))
    other = replace(some, task=replace(some.task, version=0))
    with pytest.raises(ValueError, match="made for version 0 of duel"):
        load_suite(own(other))
    other = replace(some, task=replace(some.task, rule="wait"))
    with pytest.raises(ValueError, match="rule 'wait'"):
        load_suite(own(other))
    code = tmp_path / "code.py"
    code.write_text("raise SystemExit('it ran')")
    other = replace(some, task=replace(some.task, drivers={"paddle_1": str(code)}))
    with pytest.raises(ValueError, match="unknown driver"):
        load_suite(own(other))
    off = some.position.copy()
    off[3, 2] = (0.0, 0.5)
    with pytest.raises(ValueError, match=r"puck_0 is off the table .*world 3"):
        load_suite(own(replace(some, position=off)))
    with pytest.raises(
        ValueError, match=r"position has the shape \(12, 2, 2\); expected \(12, 3, 2\)"
    ):
        load_suite(own(replace(some, position=off[:, :2])))
    with pytest.raises(ValueError, match='use observe="velocity", not estimate'):
        ah.gym_env(
            load_suite("blackout-v1").scenario,
            observe="estimate",
            drivers={"paddle_1": "still"},
        )
    for name, value in (
        ("hidden", np.nan),
        ("hidden", -1.0),
        ("difficulty", 9),
        ("position", np.inf),
    ):
        bad = {name: np.full_like(getattr(some, name), value)}
        with pytest.raises(ValueError, match=name):
            load_suite(own(replace(some, **bad)))
    (tmp_path / "empty.npz").touch()
    with pytest.raises(ValueError, match="not a suite of set pieces"):
        load_suite(tmp_path / "empty.npz")
    module._published.cache_clear()
    monkeypatch.setitem(module.SHA256, "defence-v1", "0" * 64)
    with pytest.raises(ValueError, match="not the published ones"):
        load_suite("defence-v1")
    monkeypatch.undo()
    module._published.cache_clear()
    assert isinstance(load_pieces("defence-v1"), Pieces)
