"""Learning from recordings: the dataset, each algorithm, its losses and its files."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

pytest.importorskip("torch")


import marl_airhockey as ah
from marl_airhockey.data.files import recordings_in
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.algorithms import make_config
from marl_airhockey.learn.export import export_policy
from marl_airhockey.learn.offline.choice import learned_from
from marl_airhockey.learn.offline.config import ALGORITHMS, offline_config
from marl_airhockey.learn.offline.dataset import load_dataset
from marl_airhockey.learn.train import load_any_config, run_training
from marl_airhockey.registry import make_driver

SMALL = {"hidden": [64, 64], "total_steps": 1500, "evaluations": 3}


def record(folder, agent, scenario, episodes, **keywords):
    return record_episodes(
        make_driver(agent), agent, scenario, episodes, folder, 3, keywords
    )


@pytest.fixture(scope="module")
def expert(tmp_path_factory):
    """Recordings of the zoo's policy for reach, and of a random one."""
    folder = tmp_path_factory.mktemp("expert")
    return record(folder, "zoo/reach", "reach", 40)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mixed")
    record(folder / "expert", "zoo/reach", "reach", 20)
    record(folder / "random", "random", "reach", 20)
    return folder


def test_steps_of_the_dataset_are_those_of_the_recording(expert):
    episodes = read_recording(expert).episodes
    size = episodes[0].columns["observation"].shape[-1]
    data = load_dataset([expert], 0, 1.0, 0.99, size)
    assert len(data) == sum(len(episode) for episode in episodes)
    by_return = sorted(episodes, key=lambda e: -e.columns["reward"].sum())
    first = by_return[0]
    steps = len(first)
    np.testing.assert_array_equal(
        data.steps.observation[0], first.first["observation"][0]
    )
    np.testing.assert_array_equal(
        data.steps.next_observation[:steps], first.columns["observation"][:, 0]
    )
    np.testing.assert_array_equal(
        data.steps.observation[1:steps], data.steps.next_observation[: steps - 1]
    )
    np.testing.assert_allclose(
        data.steps.reward[:steps] * data.reward_scale,
        first.columns["reward"][:, 0],
        rtol=1e-5,
        atol=1e-7,
    )
    np.testing.assert_array_equal(
        data.steps.next_action[: steps - 1], data.steps.action[1:steps]
    )
    assert abs(float(data.steps.action.abs().max())) <= 1.0


def test_only_a_termination_ends_what_lies_ahead(tmp_path):
    path = record(tmp_path, "random", "juggle", 20)
    ended = [e.columns["terminated"][-1] for e in read_recording(path).episodes]
    assert any(ended)
    size = read_recording(path).episodes[0].columns["observation"].shape[-1]
    data = load_dataset([path], 0, 1.0, 0.99, size)
    assert int((data.steps.not_done == 0).sum()) == sum(ended)


def test_a_share_is_that_of_the_best_episodes(mixed):
    files = recordings_in([mixed])
    config = offline_config("bc", [mixed], {})
    size = read_recording(files[0]).episodes[0].columns["observation"].shape[-1]
    whole = load_dataset(files, 0, 1.0, 0.99, size)
    best = load_dataset(files, 0, 0.25, 0.99, size)
    assert len(best) < len(whole) / 2
    mean = best.steps.reward.mean() * best.reward_scale
    assert mean > 1.5 * whole.steps.reward.mean() * whole.reward_scale
    assert config.data == [str(path) for path in files]


LONG = ("td3_bc", "rebrac")
"""Algorithms whose critics need 6000 steps"""


@pytest.mark.parametrize(
    "algo",
    [pytest.param(a, marks=pytest.mark.slow if a in LONG else ()) for a in ALGORITHMS],
)
def test_what_an_expert_did_is_learned(algo, expert, tmp_path):
    steps = 6000 if algo in LONG else SMALL["total_steps"]
    config = offline_config(algo, [expert], SMALL | {"total_steps": steps})
    assert config.scenario == "reach"
    row = run_training(config, tmp_path / "run")
    assert row["success"] >= 0.9
    assert row["steps"] == steps
    assert load_any_config(tmp_path / "run") == config
    driver = ah.make_driver(tmp_path / "run")
    assert evaluate(driver, "reach", episodes=50).success >= 0.9


def test_a_run_that_was_cut_off_goes_on(expert, tmp_path):
    config = offline_config("iql", [expert], SMALL)
    calls = []

    def stop(done, total, row):
        calls.append(done)
        if len(calls) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_training(config, tmp_path, stop)
    begun = len((tmp_path / "evaluations.csv").read_text().splitlines())
    row = run_training(None, tmp_path)
    assert row["steps"] == SMALL["total_steps"]
    assert len((tmp_path / "evaluations.csv").read_text().splitlines()) > begun
    assert run_training(None, tmp_path) == row, "there is nothing left to do"
    card = export_policy(tmp_path, tmp_path / "reach.npz").card
    given = f"airhockey train reach --seed 0 --algo iql --data {expert.name} "
    assert card["command"].startswith(given)
    assert ah.load_policy(tmp_path / "reach.npz").trained_in["scenario"] == "reach"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"hidden": []}, "widths above 0"),
        ({"share": 0.0}, "share: 0.0 must be"),
        ({"expectile": 2.0}, "expectile: 2.0"),
        ({"scenario": "touch"}, "scenario: 'touch', but the recordings are of 'reach'"),
        ({"worlds": 3}, "worlds"),
        ({"seat": 4}, "seat: 4 does not exist"),
        ({"seat": "x"}, "seat: 'x' does not exist"),
        ({"hidden": 256}, "hidden: 256; expected a list"),
        ({"hidden": [64.5]}, r"hidden\[0\]: 64.5; expected a finite whole"),
        ({"batch_size": 32.0}, "batch_size: 32.0; expected a finite whole number"),
        ({"temperature": float("nan")}, "temperature: nan; expected a finite number"),
        ({"gamma": 2.0}, "gamma: 2.0 must be"),
        ({"drivers": 3}, "drivers: 3; expected a dict"),
    ],
)
def test_bad_settings_are_named(expert, tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        run_training(offline_config("bc", [expert], SMALL | change), tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["scenario", "algo", "data"])
def test_what_is_no_setting_is_not_taken_for_one(expert, name):
    with pytest.raises(ValueError, match=f"{name}: this is an argument"):
        make_config("bc", "reach", [expert], {name: "touch"})


def test_python_takes_one_path_of_data(expert, tmp_path):
    few = SMALL | {"total_steps": 100, "evaluations": 1, "eval_episodes": 2}
    found = ah.train("reach", tmp_path, algo="td3_bc", data=str(expert), **few)
    assert found.steps == 100
    columns = (tmp_path / "progress.csv").read_text().splitlines()[0]
    assert {"train/actor", "train/critic"} <= {*columns.split(",")}


def test_observations_that_are_not_finite_are_named(tmp_path):
    path = record(tmp_path, "random", "reach", 2)
    part = next(path.glob("steps/*.parquet"))
    table = pq.read_table(part)
    rows = table["observation"].to_pylist()
    rows[7][3] = float("nan")
    k = table.schema.get_field_index("observation")
    kind = table.schema.field("observation")
    pq.write_table(table.set_column(k, kind, pa.array(rows, kind.type)), part)
    with pytest.raises(ValueError, match="observation is not finite at step 7"):
        run_training(offline_config("bc", [path], SMALL), tmp_path / "run")


def test_it_is_said_what_is_learned_from(expert, tmp_path):
    few = offline_config("bc", [record(tmp_path, "still", "reach", 4)], {"share": 0.5})
    first, *odd = learned_from(few)
    assert first == "learning from 2 of 4 episodes, 120 steps, success 0.000"
    assert odd[0] == "none of these episodes succeeded"
    assert "fewer steps than a batch has, 256" in odd[1]
    (only,) = learned_from(offline_config("bc", [expert], {}))
    assert only.endswith("success 1.000")
    for player in ("goalkeeper", "random"):
        against = {"drivers": {"paddle_1": player}, "max_cycles": 20}
        record(tmp_path / "duel" / player, "striker", "duel", 1, **against)
    *_, line = learned_from(offline_config("bc", [tmp_path / "duel"], {}))
    assert line.startswith("paddle_1 is goalkeeper in evaluations")
    assert "random" in line


def test_a_damaged_checkpoint_is_named(expert, tmp_path):
    config = offline_config("bc", [expert], SMALL)

    def stop(done, total, row):
        if row:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_training(config, tmp_path, stop)
    weights = tmp_path / "last.pt"
    weights.write_bytes(weights.read_bytes()[:5000])
    with pytest.raises(ValueError, match=r"last\.pt: missing or damaged"):
        run_training(None, tmp_path)


def test_data_that_does_not_fit_is_named(expert, tmp_path):
    with pytest.raises(ValueError, match="'cql'"):
        offline_config("cql", [expert], {})
    with pytest.raises(ValueError, match="no such file"):
        offline_config("bc", ["nowhere"], {})
    with pytest.raises(ValueError, match="it contains no recording"):
        offline_config("bc", [tmp_path], {})
    record(tmp_path, "still", "touch", 2)
    with pytest.raises(ValueError, match="scenario is 'touch', but in"):
        offline_config("bc", [expert, tmp_path], {})


@pytest.mark.parametrize("given", [{"options": {"goals": "dict"}}, {"goals": "dict"}])
def test_recordings_with_goals_apart_are_learned_from(tmp_path, given):
    apart = tmp_path / "goals"
    record(apart, "still", "hit_goal", 2, **given)
    run_training(offline_config("bc", [apart], SMALL), tmp_path / "run")
    policy = make_driver(tmp_path / "run")
    assert evaluate(policy, "hit_goal", episodes=2, goals="dict").episodes == 2


def test_recordings_of_pixels_are_cloned_from_pixels_alone(tmp_path):
    record(tmp_path, "still", "hit_goal", 2, observe="pixels")
    assert offline_config("bc", [tmp_path], {}).observe == "pixels"
    with pytest.raises(ValueError, match="bc alone"):
        offline_config("iql", [tmp_path], SMALL)
    size = ah.make_world("hit_goal", 1).observer.layout.centre.size
    with pytest.raises(ValueError, match="no observations"):
        load_dataset(recordings_in([tmp_path]), 0, 1.0, 0.99, size)
