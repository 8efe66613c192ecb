"""Train IQL with TorchRL on a Minari dataset, without this library.

    airhockey data export airhockey/reach/expert-v0 --name airhockey/reach/expert-v0
    python scripts/tutorials/with_minari.py airhockey/reach/expert-v0 --steps 2000

The dataset is loaded by `minari` alone. The defaults of TorchRL differ from the paper
of implicit Q-learning. The settings of this script are those of the paper.
"""

from __future__ import annotations

from typing import Annotated

import minari
import numpy as np
import torch
import typer
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.modules import MLP, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import IQLLoss, SoftUpdate


def load_steps(name: str) -> TensorDict:
    """Return all steps of a dataset as one batch (N,)."""
    parts: dict[str, list[np.ndarray]] = {}
    for episode in minari.load_dataset(name).iterate_episodes():
        own = {
            "observation": episode.observations[:-1],
            "next": episode.observations[1:],
            "action": episode.actions,
            "reward": episode.rewards[:, None],
            "terminated": episode.terminations[:, None],
            "truncated": episode.truncations[:, None],
        }
        for key, values in own.items():
            parts.setdefault(key, []).append(values)
    steps = {k: torch.from_numpy(np.concatenate(v)) for k, v in parts.items()}
    after = {
        "observation": steps["next"],
        "reward": steps["reward"].float(),
        "terminated": steps["terminated"],
        "done": steps["terminated"] | steps["truncated"],
    }
    now = {name: steps[name] for name in ("observation", "action")}
    return TensorDict({**now, "next": after}, batch_size=[len(steps["action"])])


def make_loss(observations: int, actions: int) -> tuple[IQLLoss, nn.Module]:
    """Return the loss of IQL and the network of the actor.

    The networks have two hidden layers of 256 units.
    """
    network = nn.Sequential(
        MLP(observations, 2 * actions, num_cells=[256, 256]), NormalParamExtractor()
    )
    keys = ["loc", "scale"]
    actor = ProbabilisticActor(
        TensorDictModule(network, in_keys=["observation"], out_keys=keys),
        in_keys=keys,
        distribution_class=TanhNormal,
    )
    critic = ValueOperator(
        MLP(observations + actions, 1, num_cells=[256, 256]),
        in_keys=["observation", "action"],
    )
    value = ValueOperator(
        MLP(observations, 1, num_cells=[256, 256]), in_keys=["observation"]
    )
    loss = IQLLoss(
        actor,
        critic,
        value_network=value,
        loss_function="l2",
        temperature=3.0,
        expectile=0.7,
    )
    loss.make_value_estimator(gamma=0.99)
    return loss, network


def main(
    name: Annotated[str, typer.Argument(help="Name of the Minari dataset.")],
    steps: Annotated[int, typer.Option(help="Number of gradient steps.")] = 2000,
    seed: Annotated[int, typer.Option(help="Seed of the networks.")] = 0,
) -> None:
    """Load a dataset and train."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    data = load_steps(name)
    # Actions of exactly 1 have no density if a tanh limits them.
    data["action"].clamp_(-1 + 1e-5, 1 - 1e-5)
    buffer = TensorDictReplayBuffer(
        storage=LazyTensorStorage(len(data)), batch_size=256
    )
    buffer.extend(data)
    sizes = data["observation"].shape[-1], data["action"].shape[-1]
    loss, network = make_loss(*sizes)
    follow = SoftUpdate(loss, tau=0.005)
    optimizer = torch.optim.Adam(loss.parameters(), lr=3e-4)
    for step in range(steps):
        losses = loss(buffer.sample())
        total = losses["loss_actor"] + losses["loss_qvalue"] + losses["loss_value"]
        optimizer.zero_grad()
        total.backward()
        optimizer.step()
        follow.step()
        if (step + 1) % max(steps // 4, 1) == 0:
            shown = {k: round(v.item(), 3) for k, v in losses.items() if "loss" in k}
            print(f"step {step + 1} of {steps}: {shown}")
    with torch.no_grad():
        location, _ = network(data["observation"])
    error = (torch.tanh(location) - data["action"]).abs().mean()
    print(f"{len(data)} steps, mean error of the action {error:.3f}")


if __name__ == "__main__":
    typer.run(main)
