"""Losses of offline algorithms: those of TorchRL, and whose gradients they are."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("torchrl.objectives")

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl import objectives
from torchrl.modules import IndependentNormal, ProbabilisticActor, ValueOperator

from marl_airhockey.data.record import record_episodes
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.offline.dataset import load_dataset
from marl_airhockey.learn.offline.iql import ImplicitQLearning
from marl_airhockey.learn.offline.rebrac import ReBRAC
from marl_airhockey.learn.offline.td3_bc import TD3BC
from marl_airhockey.registry import make_driver

SMALL = {"hidden": [64, 64], "alpha": 2.5}
SIZE = 8
"""Numbers of an observation of reach"""
VALUE = {"in_keys": ["observation", "action"], "out_keys": ["state_action_value"]}


@pytest.fixture(scope="module")
def expert(tmp_path_factory):
    path = tmp_path_factory.mktemp("expert") / "recording"
    agent = make_driver("zoo/reach")
    return record_episodes(agent, "zoo/reach", "reach", 40, path, 3, {})


@pytest.fixture
def batch(expert):
    torch.manual_seed(0)
    return load_dataset([expert], 0, 1.0, 0.99, SIZE).sample(256)


def model_of(kind, name, expert):
    """An algorithm whose networks are not those of its beginning."""
    torch.manual_seed(1)
    config = offline_config(name, [expert], SMALL)
    model = kind(config, np.zeros(SIZE, "f4"), np.ones(SIZE, "f4"))
    with torch.no_grad():
        for parameter in model.parameters():
            parameter += 0.1 * torch.randn_like(parameter)
    return model


class Critic(nn.Module):
    """One of two stacked critics."""

    def __init__(self, twins, k):
        super().__init__()
        pairs = zip(twins.weights, twins.biases, strict=True)
        self.layers = nn.ParameterList(
            part[k].detach().clone() for pair in pairs for part in pair
        )

    def forward(self, x, a):
        x = torch.cat([x, a], -1)
        for at in range(0, len(self.layers), 2):
            x = torch.relu(x) if at else x
            x = x @ self.layers[at] + self.layers[at + 1]
        return x


def critics_of(twins):
    return [ValueOperator(Critic(twins, k), **VALUE) for k in range(2)]


def as_tensordict(batch):
    ended = (1 - batch.not_done[:, None]).bool()
    after = {
        "observation": batch.next_observation,
        "reward": batch.reward[:, None],
        "done": ended,
        "terminated": ended,
    }
    now = {"observation": batch.observation, "action": batch.action}
    return TensorDict({**now, "next": after}, [len(batch.action)])


@pytest.mark.filterwarnings("ignore:No target network updater")
def test_losses_of_iql_are_those_of_torchrl(expert, batch):
    ours = model_of(ImplicitQLearning, "iql", expert)
    config = ours.config
    with torch.no_grad():  # TorchRL has no targets here: they are the critics.
        ours.targets.load_state_dict(ours.critics.state_dict())

    class Mean(nn.Module):
        def forward(self, x):
            mean = ours.actor(x)
            return mean, ours.log_std.exp().expand_as(mean)

    actor = ProbabilisticActor(
        TensorDictModule(Mean(), ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
    )
    theirs = objectives.IQLLoss(
        actor,
        critics_of(ours.critics),
        ValueOperator(ours.value, in_keys=["observation"]),
        loss_function="l2",
        temperature=config.temperature,
        expectile=config.expectile,
    )
    theirs.make_value_estimator(gamma=config.gamma)
    losses, found = ours.losses(0, batch), theirs(as_tensordict(batch))
    for name, key in (("value", "value"), ("critic", "qvalue"), ("actor", "actor")):
        wanted = found[f"loss_{key}"].item()
        assert losses[name].item() == pytest.approx(wanted, rel=1e-5, abs=1e-6)


@pytest.mark.filterwarnings("ignore:No target network updater")
def test_losses_of_td3_bc_are_those_of_torchrl(expert, batch):
    ours = model_of(TD3BC, "td3_bc", expert)
    config = ours.config
    with torch.no_grad():
        ours.critic_targets.load_state_dict(ours.critics.state_dict())
        ours.actor_target.load_state_dict(ours.actor.state_dict())
    actor = TensorDictModule(
        nn.Sequential(*ours.actor, nn.Tanh()), ["observation"], ["action"]
    )
    theirs = objectives.TD3BCLoss(
        actor,
        critics_of(ours.critics),
        bounds=(-1.0, 1.0),
        alpha=config.alpha,
        policy_noise=config.target_noise,
        noise_clip=config.noise_clip,
        loss_function="l2",
    )
    theirs.make_value_estimator(gamma=config.gamma)
    torch.manual_seed(2)
    losses = ours.losses(0, batch)
    torch.manual_seed(2)  # The same noise of the target actions.
    critic, _ = theirs.qvalue_loss(as_tensordict(batch))
    policy, _ = theirs.actor_loss(as_tensordict(batch))
    assert losses["critic"].item() == pytest.approx(critic.item(), rel=1e-5)
    assert losses["actor"].item() == pytest.approx(policy.item(), rel=1e-5)


def test_rebrac_without_penalties_and_normalization_is_td3_bc(
    expert, batch, monkeypatch
):
    monkeypatch.setattr(ReBRAC, "NORMALIZED", False)
    plain = model_of(TD3BC, "td3_bc", expert)
    torch.manual_seed(1)
    changes = {**SMALL, "actor_penalty": 0.2, "critic_penalty": 0.5}
    config = offline_config("rebrac", [expert], changes)
    other = ReBRAC(config, np.zeros(SIZE, "f4"), np.ones(SIZE, "f4"))
    other.load_state_dict(plain.state_dict())
    torch.manual_seed(2)
    action = torch.tanh(other.actor_target(batch.next_observation))
    noise = (0.2 * torch.randn_like(action)).clamp(-0.5, 0.5)
    action = (action + noise).clamp(-1, 1)
    distance = (action - batch.next_action).square().sum(-1)
    torch.manual_seed(2)
    target = other.critic_target(batch)
    torch.manual_seed(2)
    without = plain.critic_target(batch)
    penalty = 0.99 * batch.not_done * 0.5 * distance
    assert torch.allclose(target, without - penalty, atol=1e-5)
    # Its actor's loss is that of TD3+BC with alpha = 1 / (2 * 0.2), divided by it.
    assert other.actor_loss(batch).item() == pytest.approx(
        plain.actor_loss(batch).item() / 2.5, rel=1e-5
    )


OWN = {
    "iql": {"actor": ("actor", "log_std"), "value": ("value",), "critic": ("critics",)},
    "td3_bc": {"actor": ("actor",), "critic": ("critics",)},
    "rebrac": {"actor": ("actor",), "critic": ("critics",)},
}


@pytest.mark.parametrize(
    ("kind", "name"),
    [(ImplicitQLearning, "iql"), (TD3BC, "td3_bc"), (ReBRAC, "rebrac")],
)
def test_gradients_of_a_loss_reach_its_own_network_alone(expert, batch, kind, name):
    model = model_of(kind, name, expert)
    losses = model.losses(0, batch)
    assert losses.keys() == OWN[name].keys()
    for loss, value in losses.items():
        model.zero_grad()
        value.backward(retain_graph=True)
        moved = {
            key.partition(".")[0]
            for key, p in model.named_parameters()
            if p.grad is not None and p.grad.abs().sum() > 0
        }
        assert moved == {*OWN[name][loss]}


def test_actor_of_td3_bc_learns_at_every_second_step(expert, batch):
    model = model_of(TD3BC, "td3_bc", expert)
    assert "actor" in model.losses(0, batch)
    assert "actor" not in model.losses(1, batch)
    before = [p.clone() for p in model.actor_target.parameters()]
    model.update_targets(1)
    after = [*model.actor_target.parameters()]
    assert all(torch.equal(x, y) for x, y in zip(before, after, strict=True))
    model.update_targets(2)
    assert not torch.equal(before[0], after[0])
