"""Soft actor-critic of stable-baselines3 with hindsight goals, over B worlds.

See Haarnoja et al. (2018) and Andrychowicz et al. (2017). With quantile critics the
algorithm is TQC of sb3-contrib (Kuznetsov et al., 2020). Each step is learned with its
goal and with goals that its episode reached later, whose rewards are computed again.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import torch
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.device import torch_device
from marl_airhockey.learn.engine import (
    evaluate_and_record,
    load_state,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.hindsight.buffer import GoalEndsReplayBuffer
from marl_airhockey.learn.hindsight.config import HindsightConfig
from marl_airhockey.learn.network import FixedScale
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.sb3 import learn_for, make_logger
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import policy_driver
from marl_airhockey.policies.torch_weights import policy_of_weights
from marl_airhockey.sim.core.errors import require

REPORT = 100
"""Number of steps of all worlds between two rows of the log."""
BUFFERS = {"relabelled": GoalEndsReplayBuffer, "recorded": HerReplayBuffer}
"""Classes of replay buffers by the setting `ends`."""
SAMPLE = 2000
"""Number of remembered states that measure the exploration."""


def train_with_hindsight(run: TrainingRun[HindsightConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation.

    A resumed run keeps its networks and fills its replay buffer again.
    """
    with training_threads(run.config.torch_threads):
        return HindsightTrainer(run).train()


class HindsightTrainer:
    """Actor and critics of a run.

    Args:
        run: Run whose folder is updated.
    """

    def __init__(self, run: TrainingRun[HindsightConfig]) -> None:
        config, steps = run.config, run.progress.steps
        self._run = run
        self._slots = SlotEnv(config.scenario, config.num_worlds, **config.keywords)
        self._env = AirHockeyVecEnv(self._slots)
        self.model = build_model(config, self._env)
        if steps:
            known = load_state(run.folder / "last.pt")
            self.model.set_parameters(known["model"], device=self.model.device)
            with torch.no_grad():
                _entropy(self.model).copy_(known["entropy"])
            self.model.num_timesteps = steps
            self.model.learning_starts += steps
        # A resumed run must not repeat the episodes of its beginning.
        self._env.seed(config.seed * 10_000 + steps % 9973)
        self.model.set_logger(make_logger(run.folder, steps))
        run.end_setup()

    def train(self) -> Metrics:
        """Train to the end of the run; return the last evaluation."""
        row = self._run.train(self._advance, self._evaluate, self.model.logger)
        self._env.close()
        return row

    def _advance(self) -> tuple[int, float]:
        """Play and learn for some steps; return the steps so far and the rate."""
        model, config = self.model, self._run.config
        # The first call also plays all random actions, before learning begins.
        random = max(model.learning_starts - model.num_timesteps, 0)
        steps = min(random + REPORT * config.num_worlds, self._run.steps_left)
        learn_for(model, steps, self._slots)
        return model.num_timesteps, config.learning_rate

    def _evaluate(self) -> Metrics:
        """Evaluate and save the policy; return the row of the evaluation."""
        make = partial(policy_driver, self.policy(), "training")
        return evaluate_and_record(self._run, make, self.model.logger, self._save)

    def policy(self) -> NumpyPolicy:
        """Return the mean action of the current policy."""
        model, config = self.model, self._run.config
        assert model.replay_buffer is not None
        card = {
            **vars(model)["card"],
            "algo": config.algo,
            "steps": model.num_timesteps,
            "bounded": True,
        }
        actor: Any = vars(model)["actor"]
        hidden = [f"latent_pi.{2 * k}" for k in range(len(config.hidden))]
        scale = actor.features_extractor.centre, 1.0 / actor.features_extractor.rate
        # The exploration depends on the state: its deviation over many states.
        seen = model.replay_buffer.sample(SAMPLE, env=model.get_vec_normalize_env())
        with torch.no_grad():
            off = actor(seen.observations) - actor(seen.observations, True)
        noise = torch.log(off.std(0).clamp(min=1e-3))
        weights, layers = actor.state_dict(), [*hidden, "mu"]
        return policy_of_weights(weights, layers, scale, noise, card)

    def _save(self, name: str) -> None:
        folder = self._run.folder
        draft = folder / f"part-{name}.pt"
        entropy = _entropy(self.model).detach()
        torch.save({"model": self.model.get_parameters(), "entropy": entropy}, draft)
        draft.replace(folder / f"{name}.pt")
        self.policy().save(folder / f"{name}.npz")


def _algorithm(name: str) -> type[OffPolicyAlgorithm]:
    """Return the class of an algorithm by the setting `critics`."""
    if name == "mean":
        return SAC
    require("sb3_contrib", "ecosystem")
    from sb3_contrib import TQC

    return TQC


def build_model(config: HindsightConfig, env: AirHockeyVecEnv) -> OffPolicyAlgorithm:
    """Return a new model, with the card of its policy as ``model.card``."""
    layout = env.world.observer.layout
    # Only finished episodes can be relabelled.
    first = max(config.learning_starts, config.num_worlds * env.world.max_cycles)
    if config.total_steps <= first:
        raise ValueError(
            f"total_steps: {config.total_steps} must be above {first}, the number of "
            "steps with random actions at the beginning (learning_starts)"
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
        device=torch_device(config.device),
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
    """Return the logarithm of the entropy weight, which is a learned parameter."""
    found: torch.Tensor = model.log_ent_coef
    return found
