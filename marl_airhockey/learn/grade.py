"""How good a policy in training is: success at a task, scores against rivals."""

from __future__ import annotations

from collections.abc import Callable

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import challenge
from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.registry import make_agent
from marl_airhockey.world.build import Keywords

EVAL_SEED = 1_000_000
"""First seed of the evaluations during training."""
Grades = dict[str, float]
"""Named numbers; the first says how good the policy is, ``return`` breaks ties."""


Seat = Callable[[bool], Driver]
"""The policy as a driver, by its mean (True) or sampling."""


def judge(seat: Seat, config: TrainConfig) -> Grades:
    """Grade a policy in training on the evaluation seeds."""
    return _scores(seat, config) if config.self_play else _success(seat, config)


def _success(seat: Seat, config: TrainConfig) -> Grades:
    mean, sampled = (
        evaluate(
            seat(deterministic),
            "training",
            config.scenario,
            config.eval_episodes,
            EVAL_SEED,
            config.keywords,
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


def _scores(seat: Seat, config: TrainConfig) -> Grades:
    """The share of won games, half the draws, against rivals; ends change by turns."""
    keywords: Keywords = {**config.keywords, "drivers": {}}
    score, margin = challenge(
        config.scenario,
        seat(True),
        [make_agent(rival) for rival in config.rivals],
        config.eval_episodes,
        EVAL_SEED,
        keywords,
    )
    grades = {"score": float(score.mean()), "return": float(margin.mean())}
    for rival, share in zip(config.rivals, score.tolist(), strict=True):
        grades[f"score/{rival}"] = share
    return grades
