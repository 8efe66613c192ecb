"""How good a policy in training is: success at a task, scores against rivals."""

from __future__ import annotations

from typing import Any

from marl_airhockey.contest import challenge
from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.policy import Policy
from marl_airhockey.make import Keywords
from marl_airhockey.match import Result, evaluate
from marl_airhockey.registry import make_driver

EVAL_SEED = 1_000_000
"""First seed of the evaluations during training."""
Grades = dict[str, float]
"""Named numbers; the first says how good the policy is, ``return`` breaks ties."""


def judge(model: Any, config: TrainConfig) -> Grades:
    """Grade a model in training on the evaluation seeds."""
    return _scores(model, config) if config.self_play else _success(model, config)


def _success(model: Any, config: TrainConfig) -> Grades:
    mean = evaluate_model(model, config, True)
    return {
        "success": mean.success,
        "success_sampled": evaluate_model(model, config, False).success,
        "first_shot": mean.first_shot,
        "return": mean.returns,
        "length": mean.length,
        "hits": mean.hits,
    }


def _scores(model: Any, config: TrainConfig) -> Grades:
    """The share of won games, half the draws, against rivals; ends change by turns."""
    keywords: Keywords = {**config.keywords, "drivers": {}}
    score, margin = challenge(
        config.scenario,
        _driver(model, config, True),
        [make_driver(rival) for rival in config.rivals],
        config.eval_episodes,
        EVAL_SEED,
        keywords,
    )
    grades = {"score": float(score.mean()), "return": float(margin.mean())}
    for rival, share in zip(config.rivals, score.tolist(), strict=True):
        grades[f"score/{rival}"] = share
    return grades


def _driver(model: Any, config: TrainConfig, deterministic: bool) -> Policy:
    def predict(observation: Any, mean: bool) -> Any:
        return model.predict(observation, deterministic=mean)[0]

    shape = model.observation_space.shape
    return Policy(predict, shape, config.observe, "training", deterministic)


def evaluate_model(model: Any, config: TrainConfig, deterministic: bool) -> Result:
    """Evaluate a model in training on the evaluation seeds."""
    return evaluate(
        _driver(model, config, deterministic),
        "training",
        config.scenario,
        config.eval_episodes,
        EVAL_SEED,
        config.keywords,
    )
