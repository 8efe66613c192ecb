"""Train MAPPO with TorchRL on rally, with a critic that observes the true state.

    python scripts/tutorials/with_torchrl.py --updates 20

`make_torchrl` steps many worlds as one environment. Teammates are one group. The key
``state`` contains the true state for the critic, which no agent observes.
"""

from __future__ import annotations

from typing import Annotated

import torch
import typer
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import RewardSum, TransformedEnv, check_env_specs
from torchrl.modules import MultiAgentMLP, ProbabilisticActor, TanhNormal
from torchrl.objectives import ClipPPOLoss, ValueEstimators

import marl_airhockey as ah

GROUP = "team_0"


class StateCritic(nn.Module):
    """Critic that returns the same value of the global state for all agents."""

    def __init__(self, size: int, agents: int) -> None:
        super().__init__()
        self.agents = agents
        self.net = nn.Sequential(
            nn.Linear(size, 64),
            nn.ReLU(),
            nn.Linear(64, 64),
            nn.ReLU(),
            nn.Linear(64, 1),
        )

    def forward(self, state: torch.Tensor) -> torch.Tensor:
        """Return the values (..., agents, 1) of states (..., D)."""
        value: torch.Tensor = self.net(state)
        return value[..., None, :].expand(*value.shape[:-1], self.agents, 1)


def make_rally(worlds: int) -> TransformedEnv:
    """Return worlds of rally that also report the returns of their episodes."""
    returns = RewardSum(in_keys=[(GROUP, "reward")], out_keys=[(GROUP, "returns")])
    return TransformedEnv(ah.make_torchrl("rally", worlds), returns)


def share_ends(data: TensorDictBase) -> None:
    """Copy the ends of episodes to each agent, in the form that the loss needs."""
    after = data["next"]
    for end in ("done", "terminated"):
        shape = after[GROUP, "reward"].shape
        after[GROUP, end] = after[end].unsqueeze(-2).expand(shape)


def make_actor(env: TransformedEnv) -> ProbabilisticActor:
    """Return a policy that all agents share and that acts on single observations."""
    agents, size = env.observation_spec[GROUP, "observation"].shape[-2:]
    network = nn.Sequential(
        MultiAgentMLP(
            size, 4, agents, centralized=False, share_params=True, depth=2, num_cells=64
        ),
        NormalParamExtractor(),
    )
    keys = [(GROUP, "loc"), (GROUP, "scale")]
    return ProbabilisticActor(
        TensorDictModule(network, in_keys=[(GROUP, "observation")], out_keys=keys),
        spec=env.full_action_spec[GROUP, "action"],
        in_keys=keys,
        out_keys=[(GROUP, "action")],
        distribution_class=TanhNormal,
        return_log_prob=True,
        log_prob_key=(GROUP, "log_prob"),
    )


def make_loss(env: TransformedEnv, actor: ProbabilisticActor) -> ClipPPOLoss:
    """Return the loss of PPO with a critic of the global state."""
    agents = env.observation_spec[GROUP, "observation"].shape[-2]
    critic = TensorDictModule(
        StateCritic(env.observation_spec["state"].shape[-1], agents),
        in_keys=["state"],
        out_keys=[(GROUP, "state_value")],
    )
    loss = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_coeff=1e-3)
    loss.set_keys(
        reward=(GROUP, "reward"),
        action=(GROUP, "action"),
        value=(GROUP, "state_value"),
        sample_log_prob=(GROUP, "log_prob"),
        done=(GROUP, "done"),
        terminated=(GROUP, "terminated"),
    )
    loss.make_value_estimator(ValueEstimators.GAE, gamma=0.98, lmbda=0.95)
    return loss


def main(
    updates: Annotated[int, typer.Option(help="Number of policy updates.")] = 20,
    frames: Annotated[
        int,
        typer.Option(
            help="Number of steps between two updates, summed over all worlds."
        ),
    ] = 6400,
    worlds: Annotated[
        int, typer.Option(help="Number of worlds in the environment.")
    ] = 64,
    seed: Annotated[int, typer.Option(help="Seed of network and environment.")] = 0,
) -> None:
    """Check the environment, then train."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    env = make_rally(worlds)
    env.set_seed(seed)
    check_env_specs(env)
    actor = make_actor(env)
    loss = make_loss(env, actor)
    optimizer = torch.optim.Adam(loss.parameters(), lr=1e-3)
    collector = Collector(
        env,
        actor,
        frames_per_batch=frames,
        total_frames=updates * frames,
        auto_register_policy_transforms=False,
    )
    for update, data in enumerate(collector):
        share_ends(data)
        with torch.no_grad():
            loss.value_estimator(data)
        flat = data.reshape(-1)
        for _ in range(4):
            for rows in torch.split(torch.randperm(len(flat)), 500):
                losses = loss(flat[rows])
                total = sum(v for k, v in losses.items() if k.startswith("loss_"))
                optimizer.zero_grad()
                total.backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimizer.step()
        done = data["next", GROUP, "done"]
        returns = data["next", GROUP, "returns"][done]
        mean = f"{returns.mean():.2f}" if len(returns) else "no episode ended"
        print(f"update {update + 1}: crossings per episode {mean}")
    collector.shutdown()


if __name__ == "__main__":
    typer.run(main)
