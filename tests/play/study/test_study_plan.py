"""Plans of studies and their orders."""

import itertools
from collections import Counter

import pytest
from study_steps import PLAN, plan_writer

from marl_airhockey.play.study.archive import claim_folder
from marl_airhockey.play.study.plan import EXAMPLE, Opponent, Plan
from marl_airhockey.play.study.plan_file import load_plan
from marl_airhockey.play.study.study import open_study


@pytest.fixture
def plan(tmp_path):
    return plan_writer(tmp_path)


@pytest.mark.parametrize("count", range(1, 9))
def test_each_opponent_comes_after_each_other_equally_often(count):
    plan = Plan(
        "duel",
        "text",
        ("yes",),
        "1",
        opponents=tuple(map(Opponent, "abcdefgh"[:count])),
    )
    rows = [plan.sequence(k) for k in range(count if count % 2 == 0 else 2 * count)]
    assert all(sorted(row) == list(range(count)) for row in rows)
    for place in range(count):
        assert len(set(Counter(row[place] for row in rows).values())) == 1
    after = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert len(after) == count * (count - 1)
    assert len(set(after.values())) <= 1
    assert plan.sequence(3) == plan.sequence(3 + len(rows))


def test_the_order_can_be_drawn_or_fixed_and_follows_the_seed(plan):
    fixed = plan(PLAN.replace("games = 1", 'games = 1\norder = "fixed"'))
    assert [fixed.sequence(k) for k in range(4)] == [[0, 1]] * 4
    drawn = plan(PLAN.replace("games = 1", 'games = 1\norder = "random"\nseed = 4'))
    found = [drawn.sequence(k) for k in range(20)]
    assert {tuple(row) for row in found} == {(0, 1), (1, 0)}
    assert found == [drawn.sequence(k) for k in range(20)]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('version = "3"', "", "version: it is missing"),
        ('version = "3"', "version = 3", "version: 3"),
        ("games = 1", "games = 0", "games"),
        ("games = 1", "games = true", "games: True"),
        ("games = 1", "game = 1", "unknown field 'game'"),
        ("games = 1", 'order = "best"', "order: 'best'.*balanced, random, fixed"),
        ('agree = ["Yes."]', "agree = []", "agree"),
        ('agree = ["Yes."]', "agree = [1]", r"agree\[0\]: 1; expected a str"),
        ('"still", {', '"striker (reaction 0.1)", {', "given twice"),
        ("reaction = 0.1", "speed = 1", "opponents: unknown field 'speed'"),
        ('name = "striker"', 'label = "x"', "opponents.name: it is missing"),
        ('id = "fun"', 'id = "Fun!"', "must consist of a-z"),
        ('text = "Fun?"', 'text = "Fun?", choices = ["x"]', "at least two"),
        ("games = 1", 'digest = "x"', "digest: this key is computed"),
        ('"origin"', '"mood"', "unknown id 'mood'"),
        ("reaction = 0.1", "reaction = 0.9", "reaction"),
        ('"still", {', '"nobody", {', "unknown driver"),
        ('"still", {', '"zoo/juggle", {', "expects observations"),
        ('{name = "striker"', '{name = "person"', "cannot give a person a handicap"),
        ('scenario = "duel"', 'scenario = "juggle"', "needs no opponents"),
        ("[options]", "[options", "not a TOML file"),
    ],
)
def test_a_bad_plan_is_named(plan, tmp_path, old, new, complaint):
    assert old in PLAN
    with pytest.raises(ValueError, match=complaint):
        open_study(plan(PLAN.replace(old, new)), tmp_path / "out")


def test_a_folder_is_that_of_one_plan(plan, tmp_path):
    plan()
    claim_folder(tmp_path / "out", tmp_path / "plan.toml")
    claim_folder(tmp_path / "out", tmp_path / "plan.toml")
    plan(PLAN.replace("games = 1", "games = 2"))
    with pytest.raises(ValueError, match="another plan"):
        claim_folder(tmp_path / "out", tmp_path / "plan.toml")
    with pytest.raises(ValueError, match=r"--out .*exists"):
        claim_folder(tmp_path / "plan.toml", tmp_path / "plan.toml")


def test_the_example_is_a_plan():
    assert load_plan(EXAMPLE).blocks == 3
