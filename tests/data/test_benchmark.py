"""Named datasets: built from seeds, the same each time, with card and scores."""

import hashlib
import json

import numpy as np
import pytest

from marl_airhockey.build import build_driven_world
from marl_airhockey.data.benchmark import synthetic
from marl_airhockey.data.benchmark.build import build_dataset, built
from marl_airhockey.data.benchmark.catalogue import (
    SNAPSHOTS,
    STEPS,
    TASKS,
    TIERS,
    datasets,
    find_dataset,
    snapshot,
)
from marl_airhockey.data.benchmark.content import (
    content_of,
    normalized_score,
    published,
    reference_returns,
)
from marl_airhockey.data.benchmark.synthetic import SyntheticHuman
from marl_airhockey.data.files import one_recording, recordings_in
from marl_airhockey.data.reader import read_head
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver

NAME = "airhockey/touch/medium-replay-v0"


def test_every_task_has_every_tier():
    names = datasets()
    assert len(names) == len(TASKS) * len(TIERS) + 1
    assert f"airhockey/{TASKS[0]}/expert-v0" in names
    for dataset in names.values():
        assert sum(part.share for part in dataset.parts) == pytest.approx(1.0)
    seeds = [d.seed(part) for d in names.values() for part in d.parts]
    assert len(set(seeds)) == len(seeds)
    assert np.diff(sorted(seeds)).min() >= 1000
    for task in TASKS:
        assert all(snapshot(task, level).exists() for level in SNAPSHOTS)


def test_published_contents_are_those_of_the_catalogue():
    contents = published()
    assert [*contents] == [*datasets()]
    for content in contents.values():
        assert STEPS <= content.steps < STEPS + 2000
        assert len(content.checksum) == 64


def test_dataset_is_the_same_each_time_it_is_built(tmp_path):
    one, two = (
        content_of(build_dataset(find_dataset(NAME), tmp_path / name, 2000))
        for name in "ab"
    )
    assert one == two
    assert 2000 <= one.steps < 2000 + 4 * 100
    again = find_dataset("airhockey/touch/medium-v0")
    other = content_of(build_dataset(again, tmp_path / "c", 2000))
    assert other.checksum != one.checksum


def test_parts_hold_the_players_they_are_named_after(tmp_path):
    folder = build_dataset(find_dataset(NAME), tmp_path / "a", 2000)
    files = recordings_in([folder])
    assert [file.name for file in files] == sorted(["random", *SNAPSHOTS])
    for file in files:
        head = read_head(file)
        assert head["scenario"] == "touch"
        assert head["players"] == [{"driver": file.name, "person": None}]


def test_card_describes_files_and_columns(tmp_path):
    folder = build_dataset(find_dataset(NAME), tmp_path / "a", 500)
    card = json.loads((folder / "croissant.json").read_text())
    assert card["alternateName"] == NAME
    assert card["conformsTo"] == "http://mlcommons.org/croissant/1.0"
    files = {file["@id"]: file for file in card["distribution"]}
    found = {p.relative_to(folder).as_posix() for p in folder.rglob("*.parquet")}
    assert files.keys() == found
    for name, file in files.items():
        data = (folder / name).read_bytes()
        assert file["sha256"] == hashlib.sha256(data).hexdigest()
    for records in card["recordSet"]:
        names = [field["name"] for field in records["field"]]
        assert {"episode", "step", "observation", "action", "reward"} <= {*names}
        for field in records["field"]:
            assert field["source"]["fileObject"]["@id"] in files


def test_names_of_built_datasets_are_paths_of_recordings(tmp_path, monkeypatch):
    monkeypatch.setattr("marl_airhockey.data.files.cache_folder", lambda: tmp_path)
    with pytest.raises(ValueError, match=f"airhockey data get {NAME}"):
        recordings_in([type(tmp_path)(NAME)])
    build_dataset(find_dataset(NAME), tmp_path / "datasets" / NAME, 500)
    assert len(recordings_in([type(tmp_path)(NAME)])) == 4
    assert built(NAME) == tmp_path / "datasets" / NAME
    with pytest.raises(ValueError, match="several recordings; give one: airhockey/"):
        one_recording(type(tmp_path)(NAME))
    part = type(tmp_path)(f"{NAME}/random")
    assert one_recording(part) == tmp_path / "datasets" / part
    with pytest.raises(
        ValueError,
        match="'airhockey/touch/best-v0'; similar names are airhockey/touch/",
    ):
        built("airhockey/touch/best-v0")


def test_scores_are_0_for_random_and_100_for_the_expert():
    low, high = reference_returns("juggle")
    assert normalized_score("juggle", low) == 0.0
    assert normalized_score("juggle", high) == 100.0
    with pytest.raises(ValueError, match="scenario of a dataset 'duel'"):
        normalized_score("duel", 0.0)


class Counting(Driver):
    """Driver whose action is the number of its step, in thousandths."""

    def reset(self, seat, rng, worlds):
        return {"count": np.zeros(worlds)}

    def act(self, view, memory):
        action = np.repeat(memory["count"][:, None] / 1000, 2, 1)
        return action, {"count": memory["count"] + 1}


def test_synthetic_human_acts_late(monkeypatch):
    for name in ("SCATTER", "BIAS", "LAPSE_RATE"):
        monkeypatch.setattr(synthetic, name, 0.0)
    monkeypatch.setattr(synthetic, "TREMOR", (0.0, 0.0))
    monkeypatch.setattr(synthetic, "SPEED", (0.5, 0.5))
    monkeypatch.setattr(synthetic, "LATENCY", (0.149, 0.151))
    world = build_driven_world(SyntheticHuman(Counting()), "juggle", 4, {})
    world.reset(0)
    actions = []
    for _ in range(10):
        world.step(np.zeros((4, 0, 2)))
        actions.append(world.requested[:, 0, 0].copy())
    wanted = 0.5 * np.maximum(np.arange(10) - 3, 0) / 1000
    assert np.allclose(np.array(actions), wanted[:, None])
    world.close()


def test_synthetic_human_is_worse_than_its_policy_and_better_than_chance():
    players = {
        "expert": make_driver("zoo/strike"),
        "synthetic": SyntheticHuman(make_driver("zoo/strike")),
        "random": make_driver("random"),
    }
    success = {
        name: evaluate(player, "strike", episodes=300, name=name).success
        for name, player in players.items()
    }
    assert success["random"] + 0.1 < success["synthetic"] < success["expert"] - 0.1
