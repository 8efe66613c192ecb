"""Behaviour cloning from pixels, with the same images as ``observe="pixels"``.

Recordings contain states, from which the images are rendered. The network is that of
Mnih et al. (2015) with half of the channels. The policy is saved as an ONNX model.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from marl_airhockey.data.reader import episodes_of
from marl_airhockey.learn.device import torch_device
from marl_airhockey.learn.engine import (
    evaluate_and_record,
    load_state,
    save_state,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.logs import RunLog
from marl_airhockey.learn.offline.choice import best_of
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.onnx_export import Graph
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.policies.policy import Policy
from marl_airhockey.registry import find_scenario
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.observable import FRAMES
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.sensing.pixels import small_picture
from marl_airhockey.sim.world.observer import PIXELS
from marl_airhockey.types import Array

REPORT = 100
"""Number of gradient steps between two reports of progress."""
COLUMNS = ("state.position", "memory.goal", "action")
"""Columns that are read."""


class PixelSteps(NamedTuple):
    """Steps of one seat with the images that it observed."""

    frames: Tensor
    """Rendered frames, (M, PIXELS, PIXELS) uint8."""
    shown: Tensor
    """Indices of the frames that are observed at a step, the newest last, (N,
    FRAMES)."""
    action: Tensor
    """Actions, -1 to 1, (N, 2)."""

    def sample(self, count: int) -> tuple[Tensor, Tensor]:
        """Return images (n, PIXELS, PIXELS, FRAMES) and actions (n, 2)."""
        rows = torch.randint(len(self.action), (count,), device=self.action.device)
        pictures = self.frames[self.shown[rows]].permute(0, 2, 3, 1)
        return pictures, self.action[rows]


def render_pictures(
    files: Sequence[Path], scene: Scene, seat: int, share: float
) -> PixelSteps:
    """Render the images that a seat observed in recordings.

    Args:
        files: Paths of the recordings.
        scene: Scene of the scenario.
        seat: Index of the seat.
        share: Share of the episodes that are used, those with the highest returns.

    Raises:
        ValueError: The recordings have no steps.
    """
    rotation = scene.table.rotation(scene.seats[seat].side)
    frames: list[Array] = []
    shown, actions = [], []
    played = [
        (path, episode.index, float(episode.columns["reward"][:, seat].sum()))
        for path in files
        for episode in episodes_of(path, ("reward",))
        if len(episode)
    ]
    if not played:
        raise ValueError(f"{files[0]}: the recording has no steps")
    best = best_of([value for *_, value in played], share)
    taken = {played[k][:2] for k in best}
    for path in files:
        for episode in episodes_of(path, COLUMNS):
            if (path, episode.index) not in taken:
                continue
            before = {
                name: np.concatenate([episode.first[name][None], episode.columns[name]])
                for name in COLUMNS[:2]
                if name in episode.columns
            }
            first, count = len(frames), len(episode)
            for t in range(count):
                position = before["state.position"][t]
                goal = before["memory.goal"][t] if "memory.goal" in before else None
                drawn = position, goal, rotation, seat, PIXELS
                frames.append(small_picture(scene, *drawn))
            past = np.arange(count)[:, None] + np.arange(1 - FRAMES, 1)
            shown.append(first + np.maximum(past, 0))
            actions.append(episode.columns["action"][:, seat])
    return PixelSteps(
        torch.from_numpy(np.stack(frames)),
        torch.from_numpy(np.concatenate(shown)),
        torch.from_numpy(np.concatenate(actions).astype(np.float32)).clamp(-1, 1),
    )


class PixelActor(nn.Module):
    """Actor on images (n, PIXELS, PIXELS, FRAMES), 0 to 255; actions are (n, 2)."""

    def __init__(self, hidden: Sequence[int]) -> None:
        super().__init__()
        layers: list[nn.Module] = [
            *(nn.Conv2d(FRAMES, 16, 8, 4), nn.ReLU()),
            *(nn.Conv2d(16, 32, 4, 2), nn.ReLU()),
            *(nn.Conv2d(32, 32, 3, 1), nn.ReLU(), nn.Flatten()),
        ]
        with torch.no_grad():
            blank = torch.zeros(1, FRAMES, PIXELS, PIXELS)
            size = nn.Sequential(*layers)(blank).shape[1]
        for width in hidden:
            layers += [nn.Linear(size, width), nn.ReLU()]
            size = width
        self.layers = nn.Sequential(*layers, nn.Linear(size, 2))

    def forward(self, pictures: Tensor) -> Tensor:
        found: Tensor = self.layers(pictures.permute(0, 3, 1, 2) / 255.0)
        return found

    def driver(self) -> Driver:
        """Return the actor as a driver."""

        def predict(observation: Any, deterministic: bool) -> Array:
            with torch.inference_mode():
                rows = torch.from_numpy(np.asarray(observation, np.float32))
                device = next(self.parameters()).device
                return np.asarray(self(rows.to(device)).cpu().numpy())

        shape = PIXELS, PIXELS, FRAMES
        return Policy(predict, shape, "pixels", "training", can_sample=False)

    def save_onnx(self, card: dict[str, Any], path: Path) -> None:
        """Write the actor as an ONNX model with a card."""
        graph = Graph()
        x = graph.node("Transpose", "observation", perm=[0, 3, 1, 2])
        x = graph.node("Div", x, graph.constant("white", 255.0))
        for i, layer in enumerate(self.layers):
            if not isinstance(layer, (nn.Conv2d, nn.Linear)):
                x = graph.node({nn.ReLU: "Relu", nn.Flatten: "Flatten"}[type(layer)], x)
                continue
            state = {k: v.cpu().numpy() for k, v in layer.state_dict().items()}
            arrays = [graph.constant(f"{k}_{i}", array) for k, array in state.items()]
            if isinstance(layer, nn.Conv2d):
                x = graph.node("Conv", x, *arrays, strides=list(layer.stride))
            else:
                x = graph.node("Gemm", x, *arrays, transB=1)
        graph.save(x, (PIXELS, PIXELS, FRAMES), card, path)


class PixelCloning:
    """Behaviour cloning from pixels in a run.

    Args:
        run: Run whose folder is updated.
    """

    def __init__(self, run: TrainingRun[OfflineConfig]) -> None:
        config = self._config = run.config
        self._run = run
        scene = find_scenario(config.scenario, **config.options).scene
        files = [Path(path) for path in config.data]
        device = torch_device(config.device)
        rendered = render_pictures(files, scene, config.seat, config.share)
        self._data = PixelSteps(*(x.to(device) for x in rendered))
        # A resumed run samples other steps than those of its beginning.
        torch.manual_seed(config.seed * 10_000 + run.progress.steps % 9973)
        self.model = PixelActor(config.hidden).to(device)
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
            return self.model.driver()

        return evaluate_and_record(self._run, make, self._log, self._save)

    def _descend(self, step: int) -> float:
        """Make one gradient step on a minibatch; return the loss."""
        pictures, action = self._data.sample(self._config.batch_size)
        for group in self._optimizer.param_groups:
            group["lr"] = self._config.rate(step)
        loss = (self.model(pictures.float()) - action).square().sum(-1).mean()
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
        self.model.save_onnx(card, folder / f"{name}.onnx")


def clone_from_pixels(run: TrainingRun[OfflineConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return PixelCloning(run).train()
