"""Compare the cost of a gradient step of IQL with TorchRL, in turns.

    python scripts/bench/offline.py --rounds 5 --steps 500

Both have networks of 256 x 256 units, batches of 256 steps of the same recording, one
thread, and Adam for all networks. Both sample a batch, make a gradient step and move
their targets. The script prints the CPU time of a step in ms, the median of the rounds,
and the ratio.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Annotated

import torch
import typer
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor, ValueOperator
from torchrl.objectives import IQLLoss, SoftUpdate

from marl_airhockey import make_driver
from marl_airhockey.data.record import record_episodes
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.offline.dataset import StepBatch, load_dataset
from marl_airhockey.learn.offline.learner import Learner
from marl_airhockey.learn.run import TrainingRun

HIDDEN = [256, 256]
BATCH = 256


def make_ours(recording: Path, folder: Path) -> Callable[[int], object]:
    """Return a function that makes our gradient step."""
    config = offline_config("iql", [recording], {"hidden": HIDDEN})
    return Learner(TrainingRun(config, folder)).descend


def make_theirs(steps: StepBatch) -> Callable[[int], object]:
    """Return a function that makes TorchRL's gradient step."""
    size = steps.observation.shape[1]
    network = nn.Sequential(MLP(size, 4, num_cells=HIDDEN), NormalParamExtractor())
    keys = ["loc", "scale"]
    actor = ProbabilisticActor(
        TensorDictModule(network, in_keys=["observation"], out_keys=keys),
        in_keys=keys,
        distribution_class=IndependentNormal,
    )
    both = ["observation", "action"]
    loss = IQLLoss(
        actor,
        ValueOperator(MLP(size + 2, 1, num_cells=HIDDEN), in_keys=both),
        value_network=ValueOperator(
            MLP(size, 1, num_cells=HIDDEN), in_keys=["observation"]
        ),
        loss_function="l2",
        temperature=3.0,
        expectile=0.7,
    )
    loss.make_value_estimator(gamma=0.99)
    follow = SoftUpdate(loss, tau=0.005)
    optimizer = torch.optim.Adam(loss.parameters(), lr=3e-4, fused=True)
    ended = (1 - steps.not_done[:, None]).bool()
    after = {
        "observation": steps.next_observation,
        "reward": steps.reward[:, None],
        "done": ended,
        "terminated": ended,
    }
    now = {"observation": steps.observation, "action": steps.action}
    data = TensorDict({**now, "next": after}, [len(ended)])
    buffer = TensorDictReplayBuffer(
        storage=LazyTensorStorage(len(data)), batch_size=BATCH
    )
    buffer.extend(data)

    def descend(step: int) -> object:
        losses = loss(buffer.sample())
        total = losses["loss_actor"] + losses["loss_qvalue"] + losses["loss_value"]
        optimizer.zero_grad()
        total.backward()
        optimizer.step()
        follow.step()
        return total.detach()

    return descend


def cost_of(step: Callable[[int], object], count: int) -> float:
    """Return the CPU time of a step, ms."""
    began = time.process_time()
    for k in range(count):
        step(k)
    return 1e3 * (time.process_time() - began) / count


def main(
    rounds: Annotated[int, typer.Option(help="Number of rounds.")] = 5,
    steps: Annotated[
        int, typer.Option(help="Number of gradient steps in a round.")
    ] = 500,
) -> None:
    """Measure and print."""
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording"
        record_episodes(make_driver("zoo/juggle"), "zoo", "juggle", 64, path, 0, {})
        ours = make_ours(path, Path(folder))
        theirs = make_theirs(load_dataset([path], 0, 1.0, 0.99, 13).steps)
        cost_of(ours, 20)
        cost_of(theirs, 20)
        pairs = [(cost_of(ours, steps), cost_of(theirs, steps)) for _ in range(rounds)]
    mine, other = (median(column) for column in zip(*pairs, strict=True))
    ratio = median(a / b for a, b in pairs)
    print(f"ours {mine:.2f} ms, TorchRL {other:.2f} ms, ratio {ratio:.2f}")


if __name__ == "__main__":
    typer.run(main)
