"""Train two policies with RLlib's new API stack, one at each end of a duel.

    python scripts/tutorials/with_rllib.py --iterations 3

This is an example of plain RLlib on the PettingZoo environment:
`ParallelPettingZooEnv`, a separate policy for each agent, a checkpoint, and one of its
policies as a driver. `airhockey train duel --engine rllib` is faster, because its
runners step many worlds.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import ray
import torch
import typer
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.multi_rl_module import MultiRLModuleSpec
from ray.rllib.core.rl_module.rl_module import RLModule, RLModuleSpec
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

import marl_airhockey as ah
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.learn.rllib import start_ray
from marl_airhockey.policies.policy import Policy
from marl_airhockey.registry import make_driver


def make_duel(_: Any) -> ParallelPettingZooEnv:
    """Return a duel of 20 s in the form that RLlib needs."""
    env = ah.parallel_env("duel", backend="numba", options={"seconds": 20.0})
    return ParallelPettingZooEnv(env)


def load_driver(checkpoint: Path, policy: str) -> Policy:
    """Load one policy of a checkpoint as a driver."""
    path = checkpoint / "learner_group" / "learner" / "rl_module" / policy
    module = RLModule.from_checkpoint(str(path))

    def predict(observation: Any, mean: bool) -> Any:
        with torch.no_grad():
            seen = torch.as_tensor(np.asarray(observation, np.float32))
            out = module.forward_inference({Columns.OBS: seen})
        return out[Columns.ACTION_DIST_INPUTS][:, :2].numpy()

    return Policy(predict, source=str(path))


def main(
    iterations: Annotated[int, typer.Option(help="Number of training iterations.")] = 3,
    steps: Annotated[
        int, typer.Option(help="Number of environment steps of each iteration.")
    ] = 4000,
    num_env_runners: Annotated[
        int, typer.Option(help="Number of additional processes.")
    ] = 0,
    games: Annotated[int, typer.Option(help="Number of games of the evaluation.")] = 50,
) -> None:
    """Train both policies, load one, and let it play a random driver."""
    start_ray(num_env_runners)
    register_env("duel", make_duel)
    names = ["p0", "p1"]
    network = DefaultModelConfig(fcnet_hiddens=[64, 64], vf_share_layers=False)
    spec = MultiRLModuleSpec(
        rl_module_specs={name: RLModuleSpec(model_config=network) for name in names}
    )
    algorithm = (
        PPOConfig()
        .environment("duel")
        .env_runners(num_env_runners=num_env_runners)
        .multi_agent(
            policies=set(names),
            policy_mapping_fn=lambda agent, episode, **_: f"p{agent[-1]}",
        )
        .rl_module(rl_module_spec=spec)
        .training(
            train_batch_size_per_learner=steps,
            minibatch_size=1000,
            num_epochs=4,
            lr=1e-3,
        )
        .learners(num_learners=0)
        .debugging(seed=0, log_level="ERROR")
        .build_algo()
    )
    for i in range(iterations):
        result = algorithm.train()["env_runners"]
        returns = result.get("agent_episode_returns_mean", {})
        shown = ", ".join(f"{k} {v:+.2f}" for k, v in sorted(returns.items()))
        print(f"iteration {i + 1}: goals per episode: {shown}")
    checkpoint = Path(tempfile.mkdtemp(prefix="duel-"))
    algorithm.save_to_path(str(checkpoint))
    algorithm.stop()
    opponents = [make_driver("random")]
    score, _ = play_against(
        "duel", load_driver(checkpoint, "p0"), opponents, games, 0, {"backend": "numba"}
    )
    print(f"{checkpoint}: p0 as a driver scores {score[0]:.3f} against random")
    ray.shutdown()


if __name__ == "__main__":
    os.environ["PYTHONWARNINGS"] = "ignore::DeprecationWarning"
    typer.run(main)
