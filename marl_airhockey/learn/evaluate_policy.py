"""Evaluation of a policy in training: success in a task, scores in a game."""

from __future__ import annotations

from collections.abc import Callable

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.learn.self_play_config import SelfPlayConfig
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.keywords import Keywords

EVAL_SEED = 1_000_000
"""First seed of the evaluations during training."""
Metrics = dict[str, float]
"""Numbers by name. The first one is the primary metric; ``return`` breaks ties."""
DriverFactory = Callable[[bool], Driver]
"""Function that returns the policy as a driver, which uses the mean action if the
argument is True and sampled actions if it is False."""


def evaluate_policy(make: DriverFactory, config: RunConfig) -> Metrics:
    """Evaluate a policy in training on the evaluation seeds."""
    if isinstance(config, SelfPlayConfig) and config.self_play:
        return _scores(make, config)
    return _success(make, config)


def _success(make: DriverFactory, config: RunConfig) -> Metrics:
    mean, sampled = (
        evaluate(
            make(deterministic),
            config.scenario,
            episodes=config.eval_episodes,
            seed=EVAL_SEED,
            name="training",
            exact=True,
            **config.keywords,
        )
        for deterministic in (True, False)
    )
    return {
        "success": mean.success,
        "success_sampled": sampled.success,
        "first_shot": mean.first_shot,
        "return": mean.returns,
        "length": mean.length,
        "hits": mean.hits,
    }


def _scores(make: DriverFactory, config: SelfPlayConfig) -> Metrics:
    """Return shares of won games, where a draw counts half; the ends alternate."""
    keywords: Keywords = {**config.keywords, "drivers": {}}
    score, margin = play_against(
        config.scenario,
        make(True),
        [make_driver(opponent) for opponent in config.eval_opponents],
        config.eval_episodes,
        EVAL_SEED,
        keywords,
    )
    metrics = {"score": float(score.mean()), "return": float(margin.mean())}
    for opponent, share in zip(config.eval_opponents, score.tolist(), strict=True):
        metrics[f"score/{opponent}"] = share
    return metrics
