"""Behaviour cloning from images, those of ``observe="pixels"`` or ``"camera"``.

Recordings are replayed, and images are rendered when their steps are sampled. The
policy is saved as an ONNX model.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.data.relabel import batches
from marl_airhockey.learn.device import torch_device
from marl_airhockey.learn.engine import (
    evaluate_and_record,
    load_state,
    save_state,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.image_export import save_image_policy
from marl_airhockey.learn.image_networks import ImageActor
from marl_airhockey.learn.logs import RunLog
from marl_airhockey.learn.offline.choice import best_of
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.policies.policy import Policy
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.image_form import (
    OWN_SIZE,
    PIXELS,
    image_form,
    shows_camera,
)
from marl_airhockey.sim.core.recording import Recording
from marl_airhockey.sim.sensing.images.images import Moving, TableImages
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.types import Array

REPORT = 100
"""Number of gradient steps between two reports of progress."""


class PixelSteps(NamedTuple):
    """N steps of one seat. Their images are rendered when they are sampled."""

    images: TableImages
    moving: Moving
    """Moving parts of the images at each step (N, ...)."""
    action: Array
    """Actions, -1 to 1, (N, 2), float32."""
    seat: int
    """Index of the seat."""

    def sample(self, rng: np.random.Generator, count: int) -> tuple[Observation, Array]:
        """Return observations (n, ...) and actions (n, 2) of random steps."""
        return self.at(rng.integers(len(self.action), size=count))

    def at(self, rows: Array) -> tuple[Observation, Array]:
        """Return observations and actions of steps, by index (n,)."""
        moving = Moving(*(part[rows] for part in self.moving))
        drawn = self.images.draw(moving, np.array([self.seat]))
        if isinstance(drawn, np.ndarray):
            return drawn[:, 0], self.action[rows]
        return {name: part[:, 0] for name, part in drawn.items()}, self.action[rows]


def augmented(seen: Observation, most: int, rng: np.random.Generator) -> Observation:
    """Return observations whose images are `shifted`."""
    if isinstance(seen, np.ndarray):
        return shifted(seen, most, rng)
    return {**seen, PIXELS: shifted(seen[PIXELS], most, rng)}


def shifted(images: Array, most: int, rng: np.random.Generator) -> Array:
    """Return images (n, H, W, channels), each shifted by up to ``most`` pixels.

    The edge is repeated (Yarats et al., 2021).
    """
    count, high, wide = images.shape[:3]
    padded = np.pad(images, ((0, 0), (most, most), (most, most), (0, 0)), "edge")
    down, right = rng.integers(2 * most + 1, size=(2, count))
    rows = down[:, None] + np.arange(high)
    columns = right[:, None] + np.arange(wide)
    number = np.arange(count)[:, None, None]
    found: Array = padded[number, rows[:, :, None], columns[:, None, :]]
    return found


def recorded_steps(
    files: Sequence[Path], observe: str, seat: int, share: float
) -> PixelSteps:
    """Replay recordings, and return the steps of a seat that observes images.

    Args:
        files: Paths of the recordings.
        observe: Observation type.
        seat: Index of the seat.
        share: Share of the episodes that are used, those with the highest returns.

    Raises:
        ValueError: The recordings have no steps.
    """
    played = [
        (path, episode.index, float(episode.columns["reward"][:, seat].sum()))
        for path in files
        for episode in episodes_of(path, ("reward",))
        if len(episode)
    ]
    if not played:
        raise ValueError(f"{files[0]}: the recording has no steps")
    chosen = {played[k][:2] for k in best_of([value for *_, value in played], share)}
    moving, actions = list[Moving](), list[Array]()
    for path in files:
        head = read_head(path)
        episodes = (e for e in episodes_of(path) if (path, e.index) in chosen)
        for batch in batches(episodes):
            replay = Replay(Recording(path, head, batch), observe=observe)
            images = replay.world.observer.images[observe]
            moving += steps_of(replay, observe)
            actions += [e.columns["action"][:, seat] for e in batch]
    every = Moving(*map(np.concatenate, zip(*moving, strict=True)))
    action = np.concatenate(actions).astype(np.float32).clip(-1, 1)
    return PixelSteps(images, every, action, seat)


def steps_of(replay: Replay, observe: str) -> list[Moving]:
    """Return the moving parts of images before each action of replayed episodes."""
    observer, steps = replay.world.observer, list[Moving]()
    replay.begin()
    for t in range(int(replay.lengths.max())):
        known = replay.world.known
        shown = observer.pictured(known.sensed, known.memory, observe)
        moving = observer.images[observe].collect(*shown)
        steps.append(Moving(*(part.copy() for part in moving)))
        replay.step(t)
    every = Moving(*(np.stack(part, 1) for part in zip(*steps, strict=True)))
    return [
        Moving(*(part[b, :length] for part in every))
        for b, length in enumerate(replay.lengths)
    ]


class PixelCloning:
    """Behaviour cloning from pixels in a run.

    Args:
        run: Run whose folder is updated.
    """

    def __init__(self, run: TrainingRun[OfflineConfig]) -> None:
        config = self._config = run.config
        self._run = run
        files = [Path(path) for path in config.data]
        self._device = torch_device(config.device)
        sampled = files, config.observe, config.seat, config.share
        self._data = recorded_steps(*sampled)
        # A resumed run samples other steps than those of its beginning.
        self._rng = np.random.default_rng([config.seed, run.progress.steps])
        torch.manual_seed(config.seed)
        shape = image_form(config.observe).shape
        own = OWN_SIZE if shows_camera(config.observe) else 0
        actor = ImageActor(shape, config.network, config.hidden, own)
        self.model = actor.to(self._device)
        self._optimizer = torch.optim.Adam(self.model.parameters(), fused=True)
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
        loss = float(np.mean([self._descend(k) for k in range(first, last)]))
        self._log.record("train/actor", loss)
        return last, self._config.learning_rate

    def _evaluate(self) -> Metrics:
        def make(_mean: bool) -> Driver:
            predict, shape = self.model.predict, self.model.shape
            form = self._config.observe
            return Policy(predict, shape, form, "training", can_sample=False)

        return evaluate_and_record(self._run, make, self._log, self._save)

    def _descend(self, step: int) -> float:
        """Make one gradient step on a minibatch; return the loss."""
        seen, actions = self._data.sample(self._rng, self._config.batch_size)
        if self._config.shift:
            seen = augmented(seen, self._config.shift, self._rng)
        action = torch.from_numpy(actions).to(self._device)
        for group in self._optimizer.param_groups:
            group["lr"] = self._config.rate(step)
        loss: Any = (self.model.at(seen) - action).square().sum(-1).mean()
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()
        self._optimizer.step()
        return float(loss.detach())

    def _save(self, name: str) -> None:
        """Save the policy and everything that a resumed run needs, under a name."""
        folder, config = self._run.folder, self._config
        save_state(folder, name, self.model, self._optimizer)
        card = {**config.card([]), "algo": config.algo}
        card["steps"] = self._run.progress.steps
        path = folder / f"{name}.onnx"
        parts = self.model.features, self.model.head, self.model.shape
        save_image_policy(*parts, card, path)


def clone_from_pixels(run: TrainingRun[OfflineConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return PixelCloning(run).train()
