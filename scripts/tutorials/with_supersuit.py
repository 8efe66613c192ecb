"""Share parameters with SuperSuit and stable-baselines3, as in PettingZoo's tutorials.

    python scripts/tutorials/with_supersuit.py --steps 200000

One policy learns to play both ends of a duel against itself. The calls are those of
PettingZoo's tutorial on SB3, with another game in the import. SuperSuit makes every
agent a slot of a vector environment, so SB3 gets ordinary environments.

Our own `make_sb3_vec` does the same for thousands of worlds in one call, with seeds and
correct values at time limits, which SuperSuit 3.11 does not have. `airhockey train
duel` adds opponents. Use this script if you already have a pipeline with SuperSuit.
"""

from __future__ import annotations

import time
import warnings
from typing import Annotated, Any

import torch
import typer
from stable_baselines3 import PPO

from marl_airhockey import duel_v1
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.registry import make_driver


def make_vec_env(copies: int) -> Any:
    """Return an SB3 VecEnv of ``copies`` duels with two slots each."""
    with warnings.catch_warnings():
        # SuperSuit uses names that gymnasium has deprecated.
        warnings.simplefilter("ignore")
        import supersuit
    env = duel_v1.parallel_env(options={"seconds": 20.0})
    slots = supersuit.pettingzoo_env_to_vec_env_v1(env)
    base = "stable_baselines3"
    return supersuit.concat_vec_envs_v1(slots, copies, num_cpus=0, base_class=base)


def watch(model: PPO, seed: int) -> dict[str, float]:
    """Play a game and return the sum of rewards of each agent."""
    env = duel_v1.env(options={"seconds": 20.0})
    env.reset(seed=seed)
    rewards = dict.fromkeys(env.possible_agents, 0.0)
    for agent in env.agent_iter():
        observation, reward, terminated, truncated, _ = env.last()
        rewards[agent] += reward
        ended = terminated or truncated
        action = None if ended else model.predict(observation, deterministic=True)[0]
        env.step(action)
    env.close()
    return rewards


def main(
    steps: Annotated[
        int, typer.Option(help="Number of steps, summed over all agents.")
    ] = 200_000,
    copies: Annotated[int, typer.Option(help="Number of duels in a batch.")] = 16,
    games: Annotated[
        int, typer.Option(help="Number of games of the evaluation.")
    ] = 100,
) -> None:
    """Train a policy and let it play itself and a random driver."""
    torch.set_num_threads(1)  # Small networks gain nothing from more.
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
    print(f"{model.num_timesteps:,} agent-steps at {rate:,.0f} per second")
    print("a game against itself:", watch(model, 0))
    opponents, player = [make_driver("random")], make_driver(model)
    score, margin = play_against("duel", player, opponents, games, 0, {})
    print(f"score against random: {score[0]:.3f} ({margin[0]:+.2f} goals per game)")


if __name__ == "__main__":
    typer.run(main)
