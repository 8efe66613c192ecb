"""Exploitability of a player: a best response, trained for a fixed number of steps."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.evaluation.games import play_against
from marl_airhockey.learn.ppo_config import PPOConfig, only_against, preset
from marl_airhockey.learn.run import ProgressCallback
from marl_airhockey.learn.settings import load_config
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.world.keywords import Keywords

GAMES = 400
"""Number of games that measure a response."""
SEED = 4_000_000
"""Seed of the first of these games."""


def best_response(
    scenario: str,
    player: str,
    steps: int,
    folder: Path,
    seed: int = 0,
    report: ProgressCallback | None = None,
) -> float:
    """Train a policy against a fixed player and return its score against the player.

    In half of the training games the player is slowed down, see
    `SelfPlayConfig.opponent_speed_range`. The score is measured at its full speed.

    Args:
        scenario: Name of a game of two or more teams.
        player: Name of a driver or path of a policy.
        steps: Number of training steps, summed over all worlds.
        folder: Folder of the run. A run that exists already is not trained again.
        seed: Seed of the worlds and of the network.
        report: Function that is called during training, see `train`.

    Returns:
        Share of games that the response won; a draw is shared by all teams. If training
        found nothing better than the player, the share is 0.5 with two teams and 0.25
        with four.

    Raises:
        ValueError: The folder contains a run of another format.
    """
    if (folder / "state.json").exists():
        load_config(PPOConfig, folder / "config.toml")
    else:
        length = {"total_steps": steps, "seed": seed, "evaluations": 4}
        config = preset(scenario, {**only_against(player), **length})
        run_training(config, folder, report)
    response, opponents = load_policy(folder / "last.npz"), [make_driver(player)]
    keywords: Keywords = {"backend": "numba"}
    score, _ = play_against(scenario, response, opponents, GAMES, SEED, keywords)
    return float(score[0])
