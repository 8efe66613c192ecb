"""Convolutional networks of policies that observe images."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch
from torch import Tensor, nn

from marl_airhockey.sim.contracts.image_form import OWN, PIXELS
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.types import Array

Shape = tuple[int, int, int]
"""Shape of an observation: height, width, channels."""
GROUP = 16
"""Number of channels that share a mean and a variance."""


class ResidualBlock(nn.Module):
    """Two convolutions whose result is added to the input (He et al., 2016)."""

    def __init__(self, channels: int, width: int, stride: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            *_convolution(channels, width, 3, stride),
            nn.ReLU(),
            *_convolution(width, width, 3, 1),
        )
        same = channels == width and stride == 1
        parts = [] if same else _convolution(channels, width, 1, stride)
        self.shortcut = nn.Sequential(*parts)

    def forward(self, x: Tensor) -> Tensor:
        added: Tensor = self.body(x) + self.shortcut(x)
        return added.relu()


def darkness(images: Tensor) -> Tensor:
    """Return the input of a network for images from 0, black, to 1, white.

    The table is nearly white. Inputs near 0 for everything but bodies and marks are
    learned many times faster.
    """
    return 1.0 - images


def small_layers(channels: int) -> nn.Sequential:
    """Return the layers of Mnih et al. (2015) with half of the channels."""
    return nn.Sequential(
        *(nn.Conv2d(channels, 16, 8, 4), nn.ReLU()),
        *(nn.Conv2d(16, 32, 4, 2), nn.ReLU()),
        *(nn.Conv2d(32, 32, 3, 1), nn.ReLU(), nn.Flatten()),
    )


def resnet18_layers(channels: int) -> nn.Sequential:
    """Return a ResNet-18 (He et al., 2016) with group instead of batch normalization.

    A mean and a variance of a batch depend on the policies that filled it, those of a
    group (Wu and He, 2018) do not.
    """
    blocks: list[nn.Module] = []
    width = 64
    for k, stage in enumerate((64, 128, 256, 512)):
        for stride in (2 if k else 1, 1):
            blocks.append(ResidualBlock(width, stage, stride))
            width = stage
    return nn.Sequential(
        *_convolution(channels, 64, 7, 2),
        nn.ReLU(),
        nn.MaxPool2d(3, 2, 1),
        *blocks,
        nn.AdaptiveAvgPool2d(1),
        nn.Flatten(),
    )


NETWORKS: dict[str, Callable[[int], nn.Sequential]] = {
    "small": small_layers,
    "resnet18": resnet18_layers,
}
"""Functions from the number of channels to convolutional layers, by name."""


class ImageActor(nn.Module):
    """Actor on images (n, H, W, channels), 0 to 255; actions are (n, 2).

    Args:
        shape: Shape of an image.
        network: Name of the convolutional layers, see `NETWORKS`.
        hidden: Widths of the hidden layers after them.
        own: Number of other inputs, which the hidden layers receive, too.

    Raises:
        ValueError: The network is unknown.
    """

    def __init__(
        self, shape: Shape, network: str, hidden: Sequence[int], own: int = 0
    ) -> None:
        super().__init__()
        if network not in NETWORKS:
            raise ValueError(unknown_name("network", network, list(NETWORKS)))
        self.shape = shape
        self.features = NETWORKS[network](shape[2])
        with torch.no_grad():
            blank = torch.zeros(1, shape[2], *shape[:2])
            size = self.features(blank).shape[1] + own
        layers: list[nn.Module] = []
        for width in hidden:
            layers += [nn.Linear(size, width), nn.ReLU()]
            size = width
        self.head = nn.Sequential(*layers, nn.Linear(size, 2))

    def forward(self, images: Tensor, own: Tensor | None = None) -> Tensor:
        features = self.features(darkness(images.permute(0, 3, 1, 2) / 255.0))
        if own is not None:
            features = torch.cat([features, own], -1)
        found: Tensor = self.head(features)
        return found

    def at(self, observation: Observation) -> Tensor:
        """Return actions (n, 2) for observations of images or of a camera."""
        device = next(self.parameters()).device
        parts = (
            [observation[name] for name in (PIXELS, OWN)]
            if isinstance(observation, Mapping)
            else [observation]
        )
        arrays = (np.asarray(part, np.float32) for part in parts)
        found: Tensor = self(*(torch.from_numpy(a).to(device) for a in arrays))
        return found

    def predict(self, observation: Observation, deterministic: bool) -> Array:
        """Return actions (n, 2) for observations of images or of a camera."""
        with torch.inference_mode():
            return np.asarray(self.at(observation).cpu().numpy())


def _convolution(channels: int, width: int, size: int, stride: int) -> list[nn.Module]:
    layer = nn.Conv2d(channels, width, size, stride, size // 2, bias=False)
    return [layer, nn.GroupNorm(width // GROUP, width)]
