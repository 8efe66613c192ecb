"""Learner: the training loop of an offline algorithm, with its logs and files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import torch

from marl_airhockey.build import build_world
from marl_airhockey.learn.device import torch_device
from marl_airhockey.learn.engine import (
    evaluate_and_record,
    load_state,
    save_weights,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.logs import RunLog
from marl_airhockey.learn.offline.actor import Algorithm
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.offline.dataset import load_dataset
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import policy_driver
from marl_airhockey.sim.contracts.scenario import GoalScenario
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

REPORT = 500
"""Number of gradient steps between two reports of progress."""


def scale_of(world: World) -> tuple[Array, Array]:
    """Return centre and unit (D,) of observations; goals of a dict have 0 and 1."""
    layout, scenario = world.observer.layout, world.scenario
    if not (isinstance(scenario, GoalScenario) and scenario.goals == "dict"):
        return layout.centre, layout.unit
    goals = np.zeros(2 * len(scenario.goal_bounds), np.float32)
    return np.append(layout.centre, goals), np.append(layout.unit, goals + 1)


class Learner:
    """Learner of a run.

    Args:
        run: Run whose folder is updated.

    Raises:
        ValueError: The recordings cannot be used for learning.
    """

    def __init__(self, run: TrainingRun[OfflineConfig]) -> None:
        config = self._config = run.config
        self._run = run
        world = build_world(config.scenario, 1, True, config.keywords)
        layout = world.observer.layout
        centre, unit = scale_of(world)
        world.close()
        self._card = config.card(layout.labels)
        files = [Path(path) for path in config.data]
        shape = config.seat, config.share, config.gamma, len(centre)
        device = torch_device(config.device)
        self._data = load_dataset(files, *shape).to(device)
        # A resumed run samples other steps than those of its beginning.
        torch.manual_seed(config.seed * 10_000 + run.progress.steps % 9973)
        make: Callable[[OfflineConfig, object, object], Algorithm] = import_module(
            f"marl_airhockey.learn.offline.{config.algo}"
        ).make
        self.model = make(config, centre, unit).to(device)
        learned = [p for p in self.model.parameters() if p.requires_grad]
        self._optimizer = torch.optim.Adam(learned, config.learning_rate, fused=True)
        if run.progress.steps:
            state = load_state(run.folder / "last.pt")
            self.model.load_state_dict(state["model"])
            self._optimizer.load_state_dict(state["optimizer"])
        self._log = RunLog(run.folder, run.progress.steps)

    def train(self) -> Metrics:
        """Train to the end of the run; return the last evaluation."""
        self._run.end_setup()
        return self._run.train(self._advance, self._evaluate, self._log)

    def _advance(self) -> tuple[int, float]:
        first = self._run.progress.steps
        last = min(first + REPORT, self._config.total_steps)
        losses: dict[str, float] = {}
        for step in range(first, last):
            # Some algorithms update the actor only at every second step.
            losses |= self.descend(step)
        for name, value in losses.items():
            self._log.record(f"train/{name}", value)
        return last, self._config.learning_rate

    def descend(self, step: int) -> dict[str, float]:
        """Make one gradient step on a minibatch; return the losses."""
        model = self.model
        batch = self._data.sample(self._config.batch_size)
        for group in self._optimizer.param_groups:
            group["lr"] = self._config.rate(step)
        scaled = batch._replace(
            observation=model.scaled(batch.observation),
            next_observation=model.scaled(batch.next_observation),
        )
        losses = model.losses(step, scaled)
        self._optimizer.zero_grad(set_to_none=True)
        torch.stack(list(losses.values())).sum().backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()
        model.update_targets(step)
        return {name: float(loss.detach()) for name, loss in losses.items()}

    def policy(self) -> NumpyPolicy:
        """Return the current policy."""
        card = {**self._card, "algo": self._config.algo}
        card["steps"] = self._run.progress.steps
        return self.model.to_numpy(card)

    def _evaluate(self) -> Metrics:
        """Evaluate and save the policy; return the row of the evaluation."""
        make = partial(policy_driver, self.policy(), "training")
        return evaluate_and_record(self._run, make, self._log, self._save)

    def _save(self, name: str) -> None:
        """Save the policy and everything that a resumed run needs, under a name."""
        parts = self.model, self._optimizer, self.policy()
        save_weights(self._run.folder, name, *parts)


def train_offline(run: TrainingRun[OfflineConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return Learner(run).train()
