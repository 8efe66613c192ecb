"""Exploitability of a player: a best response, trained for a fixed budget of steps."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.evaluation.games import play_against
from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.run import ProgressCallback
from marl_airhockey.learn.settings import load_config
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.world.keywords import Keywords

GAMES = 400
"""Games by which a response is measured"""
SEED = 4_000_000
"""Seed of the first of these games"""


def best_response(
    scenario: str,
    player: str,
    steps: int,
    folder: Path,
    seed: int = 0,
    report: ProgressCallback | None = None,
) -> float:
    """Train a policy against a fixed player and return its score against it.

    In half of the games of training the player is slowed down, see
    `SelfPlayConfig.opponent_speed_range`; the score is against the player as it is.

    Args:
        scenario: name of a game of two sides or more.
        player: a driver's name or a policy's path.
        steps: steps of single worlds.
        folder: folder of the run; a run that is there already is not trained again.
        seed: seed of worlds and network.
        report: called during training, see `train`.

    Returns:
        The response's share of won games, a draw shared by all sides: of two sides 0.5
        if training found nothing better than the player, of four 0.25.

    Raises:
        ValueError: the folder holds a run of an older version.
    """
    if (folder / "state.json").exists():
        load_config(PPOConfig, folder / "config.toml")
    else:
        only = {"opponents": [player], "eval_opponents": [player]}
        alone = {"self_play_fraction": 0.0, "scripted_fraction": 1.0, "snapshots": 1}
        length = {"total_steps": steps, "seed": seed, "evaluations": 4}
        run_training(preset(scenario, {**only, **alone, **length}), folder, report)
    response, opponents = load_policy(folder / "last.npz"), [make_driver(player)]
    keywords: Keywords = {"backend": "numba"}
    score, _ = play_against(scenario, response, opponents, GAMES, SEED, keywords)
    return float(score[0])
