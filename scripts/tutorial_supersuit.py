"""Parameter sharing with SuperSuit and stable-baselines3, as PettingZoo's tutorials do.

    python scripts/tutorial_supersuit.py --steps 200000

One policy learns to play both ends of a duel against itself. SuperSuit makes every
agent a slot of a vector environment; SB3 sees ordinary environments. Our own
`make_sb3_vec` does the same for thousands of worlds at once, with seeds and the right
values at time limits, which SuperSuit 3.11 lacks; `airhockey train duel` adds
opponents. So this suits those who have a SuperSuit pipeline already.
"""

from __future__ import annotations

import time
import warnings
from typing import Annotated, Any

import numpy as np
import torch
import typer
from stable_baselines3 import PPO

import marl_airhockey as ah
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.registry import make_driver
from marl_airhockey.toolkit.policies import Policy


def make_vec_env(copies: int) -> Any:
    """Return an SB3 VecEnv of ``copies`` duels with two slots each."""
    with warnings.catch_warnings():
        # SuperSuit uses names that gymnasium has deprecated.
        warnings.simplefilter("ignore")
        import supersuit
    env = ah.parallel_env("duel", backend="numba", options={"seconds": 20.0})
    slots = supersuit.pettingzoo_env_to_vec_env_v1(env)
    base = "stable_baselines3"
    return supersuit.concat_vec_envs_v1(slots, copies, num_cpus=0, base_class=base)


def main(
    steps: Annotated[int, typer.Option(help="Steps of single agents.")] = 200_000,
    copies: Annotated[int, typer.Option(help="Duels at once.")] = 16,
    games: Annotated[int, typer.Option(help="Games of the evaluation.")] = 100,
) -> None:
    """Train a policy and let it play a random driver."""
    torch.set_num_threads(1)  # small networks gain nothing from more
    env = make_vec_env(copies)
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=256,
        batch_size=1024,
        n_epochs=4,
        learning_rate=1e-3,
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -0.5},
        device="cpu",
    )
    began = time.perf_counter()
    model.learn(steps)
    rate = model.num_timesteps / (time.perf_counter() - began)

    def predict(observation: Any, mean: bool) -> Any:
        return np.asarray(model.predict(observation, deterministic=mean)[0])

    rivals = [make_driver("random")]
    score, margin = play_against(
        "duel", Policy(predict), rivals, games, 0, {"backend": "numba"}
    )
    print(f"{model.num_timesteps:,} agent-steps at {rate:,.0f} per second")
    print(f"score against random: {score[0]:.3f} ({margin[0]:+.2f} goals a game)")


if __name__ == "__main__":
    typer.run(main)
