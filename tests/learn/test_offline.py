"""Learning from recordings: the dataset, each algorithm, its losses and its files."""

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from torch import nn

import marl_airhockey as ah
from marl_airhockey.data.files import recordings_in
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.offline.config import ALGORITHMS, offline_config
from marl_airhockey.learn.offline.dataset import load_dataset
from marl_airhockey.learn.offline.iql import ImplicitQLearning
from marl_airhockey.learn.train import load_any_config, run_training
from marl_airhockey.registry import make_agent

SMALL = {"hidden": [64, 64], "total_steps": 1500, "evaluations": 3}


def record(folder, agent, scenario, episodes, **keywords):
    return record_episodes(
        make_agent(agent), agent, scenario, episodes, folder, 3, keywords
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
    np.testing.assert_array_equal(data.observation[0], first.first["observation"][0])
    np.testing.assert_array_equal(
        data.next_observation[:steps], first.columns["observation"][:, 0]
    )
    np.testing.assert_array_equal(
        data.observation[1:steps], data.next_observation[: steps - 1]
    )
    np.testing.assert_allclose(
        data.reward[:steps] * data.reward_scale,
        first.columns["reward"][:, 0],
        rtol=1e-5,
        atol=1e-7,
    )
    assert abs(float(data.action.abs().max())) <= 1.0


def test_only_a_termination_ends_what_lies_ahead(tmp_path):
    path = record(tmp_path, "random", "juggle", 20)
    ended = [e.columns["terminated"][-1] for e in read_recording(path).episodes]
    assert any(ended)
    size = read_recording(path).episodes[0].columns["observation"].shape[-1]
    data = load_dataset([path], 0, 1.0, 0.99, size)
    assert int((data.going == 0).sum()) == sum(ended)


def test_a_share_is_that_of_the_best_episodes(mixed):
    files = recordings_in([mixed])
    config = offline_config("bc", [mixed], {})
    size = read_recording(files[0]).episodes[0].columns["observation"].shape[-1]
    whole = load_dataset(files, 0, 1.0, 0.99, size)
    best = load_dataset(files, 0, 0.25, 0.99, size)
    assert len(best) < len(whole) / 2
    mean = best.reward.mean() * best.reward_scale
    assert mean > 1.5 * whole.reward.mean() * whole.reward_scale
    assert config.data == [str(path) for path in files]


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_what_an_expert_did_is_learned(algo, expert, tmp_path):
    config = offline_config(algo, [expert], SMALL)
    assert config.scenario == "reach"
    row = run_training(config, tmp_path / "run")
    assert row["success"] >= 0.9
    assert row["steps"] == SMALL["total_steps"]
    assert load_any_config(tmp_path / "run") == config
    driver = ah.make_agent(tmp_path / "run")
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


@pytest.mark.filterwarnings("ignore:No target network updater")
def test_losses_of_iql_are_those_of_an_independent_implementation(expert):
    torchrl = pytest.importorskip("torchrl.objectives")
    from tensordict import TensorDict
    from tensordict.nn import TensorDictModule
    from torchrl.modules import IndependentNormal, ProbabilisticActor, ValueOperator

    torch.manual_seed(0)
    config = offline_config("iql", [expert], SMALL)
    size = read_recording(expert).episodes[0].columns["observation"].shape[-1]
    ours = ImplicitQLearning(config, np.zeros(size, "f4"), np.ones(size, "f4"))
    with torch.no_grad():
        ours.log_std.fill_(-0.3)
    data = load_dataset([expert], 0, 1.0, config.gamma, size)
    observation, action, reward, after, going = data.draw(256)
    losses = ours.losses(0, observation, action, reward, after, going)

    class Mean(nn.Module):
        def forward(self, x):
            mean = ours.actor(x)
            return mean, ours.log_std.exp().expand_as(mean)

    class Critic(nn.Module):
        def __init__(self, k):
            super().__init__()
            pairs = zip(ours.critics.weights, ours.critics.biases, strict=True)
            self.layers = nn.ParameterList(
                part[k].detach().clone() for pair in pairs for part in pair
            )

        def forward(self, x, a):
            x = torch.cat([x, a], -1)
            for at in range(0, len(self.layers), 2):
                x = torch.relu(x) if at else x
                x = x @ self.layers[at] + self.layers[at + 1]
            return x

    actor = ProbabilisticActor(
        TensorDictModule(Mean(), ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
    )
    names = {"in_keys": ["observation", "action"], "out_keys": ["state_action_value"]}
    theirs = torchrl.IQLLoss(
        actor,
        [ValueOperator(Critic(k), **names) for k in range(2)],
        ValueOperator(ours.value, in_keys=["observation"]),
        loss_function="l2",
        temperature=config.temperature,
        expectile=config.expectile,
    )
    theirs.make_value_estimator(gamma=config.gamma)
    ended = (1 - going[:, None]).bool()
    batch = TensorDict(
        {
            "observation": observation,
            "action": action,
            "next": {
                "observation": after,
                "reward": reward[:, None],
                "done": ended,
                "terminated": ended,
            },
        },
        [256],
    )
    found = theirs(batch)
    for name, key in (("value", "value"), ("critic", "qvalue"), ("actor", "actor")):
        wanted = found[f"loss_{key}"].item()
        assert losses[name].item() == pytest.approx(wanted, rel=1e-5, abs=1e-6)


def test_gradients_of_a_loss_reach_its_own_network_alone(expert):
    config = offline_config("iql", [expert], SMALL)
    size = read_recording(expert).episodes[0].columns["observation"].shape[-1]
    model = ImplicitQLearning(config, np.zeros(size, "f4"), np.ones(size, "f4"))
    batch = load_dataset([expert], 0, 1.0, 0.99, size).draw(64)
    own = {"actor": ("actor", "log_std"), "value": ("value",), "critic": ("critics",)}
    for name, loss in model.losses(0, *batch).items():
        model.zero_grad()
        loss.backward()
        moved = {
            key.partition(".")[0]
            for key, p in model.named_parameters()
            if p.grad is not None and p.grad.abs().sum() > 0
        }
        assert moved <= set(own[name])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"hidden": []}, "widths above 0"),
        ({"share": 0.0}, "share: 0.0 must be"),
        ({"expectile": 2.0}, "expectile: 2.0"),
        ({"scenario": "touch"}, "scenario: 'touch', but the recordings are of 'reach'"),
        ({"worlds": 3}, "worlds"),
        ({"seat": 4}, "there is no seat 4"),
    ],
)
def test_bad_settings_are_named(expert, tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        run_training(offline_config("bc", [expert], SMALL | change), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_data_that_does_not_fit_is_named(expert, tmp_path):
    with pytest.raises(ValueError, match="'cql'"):
        offline_config("cql", [expert], {})
    with pytest.raises(ValueError, match="no such file"):
        offline_config("bc", ["nowhere"], {})
    with pytest.raises(ValueError, match="there are no recordings"):
        offline_config("bc", [tmp_path], {})
    record(tmp_path, "still", "touch", 2)
    with pytest.raises(ValueError, match="scenario is 'touch', that of"):
        offline_config("bc", [expert, tmp_path], {})
    apart = tmp_path / "goals"
    record(apart, "still", "hit_goal", 2, options={"goals": "dict"})
    with pytest.raises(ValueError, match="no flat observations"):
        run_training(offline_config("bc", [apart], SMALL), tmp_path / "run")
