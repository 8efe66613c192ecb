"""The protocol by which players are compared, and its card."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from marl_airhockey.evaluation import challenge, population
from marl_airhockey.evaluation.challenge import find_player, play_challenge
from marl_airhockey.evaluation.challenge_report import ChallengeReport
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.registry import make_scenario


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Two tasks, two profiles, one opponent, one of the population, one suite."""
    monkeypatch.setattr(challenge, "TASKS", ("reach", "touch"))
    monkeypatch.setattr(challenge, "PROFILES", ("ideal", "ur5e"))
    monkeypatch.setattr(challenge, "FIELD", ("random",))
    member = str(population.FOLDER / "early.npz")
    monkeypatch.setattr(challenge, "opponents", lambda: {"population/early": member})
    monkeypatch.setattr(challenge, "suite_names", lambda: ["attack-v1"])


def test_the_zoo_has_a_card(tmp_path):
    seen = []
    card = play_challenge("zoo", "ours", "0", 20, 2, seen.append)
    assert tuple(seen) == card.results
    assert [r.player for r in card.results] == [
        "reach.npz",
        "touch.npz",
        "reach_ur5e.npz",
        "touch_ur5e.npz",
        *["duel.npz"] * 3,
    ]
    assert set(card.files) == {r.player for r in card.results}
    assert all(r.score >= 0.8 for r in card.results[:-1])
    mean, low, high = card.totals["tasks"]
    assert mean == pytest.approx(sum(r.score for r in card.results[:4]) / 4)
    assert low < mean <= high
    assert card.totals["population"][0] == card.results[-2].score
    assert card.totals["set pieces"][0] == card.results[-1].score > 0.3
    files = card.save(tmp_path)
    assert ChallengeReport.from_json(files[0].read_text()) == card
    assert "| reach | ur5e | reach_ur5e.npz | " in files[1].read_text()
    assert files[2].stat().st_size > 10_000


def test_what_is_not_played_counts_as_nothing():
    card = play_challenge("reacher", "reacher", "0", 20, 2)
    reach, touch = card.results[:2]
    assert reach.score == 1.0
    assert (touch.score, touch.player) == (0.0, "")
    assert "has no goal" in touch.note
    assert card.totals["ideal"][0] == 0.5
    with pytest.raises(ValueError, match="plays no part of the challenge"):
        play_challenge("nobody", "nobody", "0", 2, 2)


def test_a_policy_for_a_profile_comes_first(tmp_path):
    for name in ("juggle.npz", "juggle_ur5e.npz", "touch.onnx"):
        (tmp_path / name).touch()
    found = [find_player(str(tmp_path), "juggle", p) for p in ("ideal", "ur5e")]
    assert [path.rpartition("/")[2] for path in found] == [
        "juggle.npz",
        "juggle_ur5e.npz",
    ]
    assert find_player(str(tmp_path), "touch", "gantry").endswith("touch.onnx")
    assert find_player(str(tmp_path), "strike", "ideal") == ""
    assert find_player("allround", "strike", "ideal") == "allround"


def test_cards_of_other_protocols_are_refused():
    card = replace(play_challenge("reacher", "reacher", "0", 2, 2), protocol=0)
    with pytest.raises(ValueError, match="protocol 0"):
        ChallengeReport.from_json(card.to_json())
    with pytest.raises(ValueError, match="not a card"):
        ChallengeReport.from_json(json.dumps({"name": "x"}))


def test_the_population_is_the_published_one(tmp_path, monkeypatch):
    found = population.opponents()
    assert len(found) == 8
    for path in found.values():
        card = NumpyPolicy.load(Path(path)).card
        assert card["version"] == make_scenario("duel").version
        assert not {"seed", "command"} & set(card)
    shutil.copytree(population.FOLDER, tmp_path / "changed")
    monkeypatch.setattr(population, "FOLDER", tmp_path / "changed")
    (tmp_path / "changed" / "soft.npz").write_bytes(b"another")
    with pytest.raises(ValueError, match="install marl_airhockey again"):
        population.opponents()
    (tmp_path / "changed" / "soft.npz").unlink()
    with pytest.raises(ValueError, match="install marl_airhockey again"):
        population.opponents()
