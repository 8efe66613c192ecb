"""Soft actor-critic of stable-baselines3 with hindsight goals, over B worlds.

Haarnoja et al. (2018); Andrychowicz et al. (2017); with quantile critics, TQC of
sb3-contrib, Kuznetsov et al. (2020). A step of an episode is learned from
with the goal that it had and with goals that the episode came to later; the rewards of
those are computed anew.
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.engine import (
    evaluate_and_record,
    load_state,
    note_step,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.hindsight.buffer import GoalEndsReplayBuffer
from marl_airhockey.learn.hindsight.config import HindsightConfig
from marl_airhockey.learn.network import FixedScale
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.sb3 import make_logger
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.torch_weights import policy_of_weights
from marl_airhockey.sim.core.errors import require

REPORT = 100
"""Steps of all worlds from one report of progress to the next"""
BUFFERS = {"relabelled": GoalEndsReplayBuffer, "recorded": HerReplayBuffer}
"""Buffers by the setting `ends`"""
SAMPLE = 2000
"""Remembered states in which the exploration is measured"""


def train_with_hindsight(run: TrainingRun[HindsightConfig]) -> Metrics:
    """Train a run from where it stands to its end; return the last evaluation.

    One that goes on has its networks, and fills its memory anew.
    """
    config = run.config
    with training_threads(config.torch_threads):
        env = AirHockeyVecEnv(
            SlotEnv(config.scenario, config.num_worlds, **config.keywords)
        )
        logger = make_logger(run.folder, run.progress.steps)
        try:
            return _train(run, env, logger)
        finally:
            logger.close()
            env.close()


def _train(
    run: TrainingRun[HindsightConfig], env: AirHockeyVecEnv, logger: Logger
) -> Metrics:
    config, progress = run.config, run.progress
    model = build_model(config, env)
    if progress.steps:
        known = load_state(run.folder / "last.pt")
        model.set_parameters(known["model"], device="cpu")
        with torch.no_grad():
            _entropy(model).copy_(known["entropy"])
        model.num_timesteps = progress.steps
        model.learning_starts += progress.steps
    # A resumed run must not repeat the episodes of its beginning.
    env.seed(config.seed * 10_000 + progress.steps % 9973)
    model.set_logger(logger)
    callback = Evaluations(run)
    run.end_setup()
    model.learn(run.steps_left, callback, reset_num_timesteps=False)
    row = callback.evaluate()
    logger.dump(progress.steps)
    return row


def _algorithm(name: str) -> type[OffPolicyAlgorithm]:
    """Return the class of an algorithm by the setting `critics`."""
    if name == "mean":
        return SAC
    require("sb3_contrib", "ecosystem")
    from sb3_contrib import TQC

    return TQC


def build_model(config: HindsightConfig, env: AirHockeyVecEnv) -> OffPolicyAlgorithm:
    """Return a fresh model, with the card of its policy as ``model.card``."""
    layout = env.world.observer.layout
    # An episode can be learned from when it has ended.
    first = max(config.learning_starts, config.num_worlds * env.world.max_cycles)
    if config.total_steps <= first:
        raise ValueError(
            f"total_steps: {config.total_steps} must be above {first}, the steps of "
            "random actions with which learning begins (learning_starts)"
        )
    model = _algorithm(config.critics)(
        "MultiInputPolicy",
        env,
        learning_rate=config.learning_rate,
        buffer_size=config.memory_steps,
        learning_starts=first,
        batch_size=config.batch_size,
        tau=config.tau,
        gamma=config.gamma,
        train_freq=1,
        gradient_steps=config.gradient_steps,
        replay_buffer_class=BUFFERS[config.ends],
        replay_buffer_kwargs={"n_sampled_goal": config.relabelled},
        seed=config.seed,
        device="cpu",
        policy_kwargs={
            "net_arch": config.hidden,
            "features_extractor_class": FixedScale,
            "features_extractor_kwargs": {
                "centre": layout.centre.tolist(),
                "unit": layout.unit.tolist(),
            },
        },
    )
    vars(model)["card"] = config.card(layout.labels)
    return model


def _entropy(model: Any) -> torch.Tensor:
    """Return the logarithm of the weight of the entropy, which is learned."""
    found: torch.Tensor = model.log_ent_coef
    return found


class Evaluations(BaseCallback):
    """Callback that logs, evaluates and saves the policy during training.

    Args:
        run: whose folder is kept up to date.
    """

    def __init__(self, run: TrainingRun[HindsightConfig]) -> None:
        super().__init__()
        self._run = run

    def _on_step(self) -> bool:
        env = self.training_env
        assert isinstance(env, AirHockeyVecEnv)
        note_step(self.logger, env.slots)
        if self.n_calls % REPORT == 0:
            self._update_progress()
            started = self.num_timesteps > self._learner.learning_starts
            if self._run.evaluation_due and started:
                self.evaluate()
        return True

    @property
    def _learner(self) -> OffPolicyAlgorithm:
        assert isinstance(self.model, OffPolicyAlgorithm)
        return self.model

    def _update_progress(self) -> None:
        self._run.update_progress(self.num_timesteps, self._run.config.learning_rate)

    def evaluate(self) -> Metrics:
        """Evaluate and save the policy; return the evaluation's row."""
        self._update_progress()
        return evaluate_and_record(self._run, self._policy(), self.logger, self._save)

    def _policy(self) -> NumpyPolicy:
        """Return the mean action of the policy as it is."""
        model = self._learner
        assert model.replay_buffer is not None
        card = {
            **vars(model)["card"],
            "algo": self._run.config.algo,
            "steps": self.num_timesteps,
            "bounded": True,
        }
        actor: Any = vars(model)["actor"]
        hidden = [f"latent_pi.{2 * k}" for k in range(len(self._run.config.hidden))]
        scale = actor.features_extractor.centre, 1.0 / actor.features_extractor.rate
        # Its exploration differs from state to state: what it is on the whole.
        seen = model.replay_buffer.sample(SAMPLE, env=model.get_vec_normalize_env())
        with torch.no_grad():
            off = actor(seen.observations) - actor(seen.observations, True)
        noise = torch.log(off.std(0).clamp(min=1e-3))
        weights, layers = actor.state_dict(), [*hidden, "mu"]
        return policy_of_weights(weights, layers, scale, noise, card)

    def _save(self, name: str) -> None:
        folder = self._run.folder
        draft = folder / f"part-{name}.pt"
        known = {
            "model": self._learner.get_parameters(),
            "entropy": _entropy(self._learner).detach(),
        }
        torch.save(known, draft)
        draft.replace(folder / f"{name}.pt")
        self._policy().save(folder / f"{name}.npz")
