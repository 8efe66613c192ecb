"""NumPy policy: a learned network as plain arrays, in one small file."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.types import Array

LARGEST = 64_000_000
"""Largest number of bytes that the arrays of a file may take."""


@dataclass(frozen=True)
class NumpyPolicy:
    """Network with ReLU layers that returns the mean action.

    Args:
        layers: (out, in) weights and (out,) biases of each layer.
        centre: (D,) subtracted from the observation.
        unit: (D,) divisor of the difference.
        log_std: (2,) log standard deviation of the action noise in training.
        card: scenario and its version, settings and results of the training.
    """

    layers: Sequence[tuple[Array, Array]]
    centre: Array
    unit: Array
    log_std: Array
    card: Mapping[str, Any] = field(default_factory=dict)

    def __call__(
        self, observation: Array | Mapping[str, Array], deterministic: bool = True
    ) -> Array:
        """Return mean actions (B, 2) for observations (B, D); the driver adds noise.

        Goals that are given apart follow the rest, as in a dict of gymnasium's.
        """
        if isinstance(observation, Mapping):
            parts = ("observation", "achieved_goal", "desired_goal")
            observation = np.concatenate([observation[part] for part in parts], -1)
        x = (observation - self.centre) / self.unit
        for weight, bias in self.layers[:-1]:
            x = np.maximum(x @ weight.T + bias, 0.0)
        weight, bias = self.layers[-1]
        return np.asarray(x @ weight.T + bias)

    def save(self, path: Path) -> None:
        """Write an .npz that includes the card; the file is replaced atomically."""
        arrays: dict[str, Any] = {
            f"weight_{i}": w for i, (w, _) in enumerate(self.layers)
        }
        arrays |= {f"bias_{i}": b for i, (_, b) in enumerate(self.layers)}
        draft = path.with_name(f"part-{path.name}")
        np.savez_compressed(
            draft,
            centre=self.centre,
            unit=self.unit,
            log_std=self.log_std,
            card=np.array(json.dumps(dict(self.card))),
            **arrays,
        )
        draft.replace(path)

    @staticmethod
    def load(path: Path) -> NumpyPolicy:
        """Read a file that `save` wrote.

        Raises:
            ValueError: a file of another kind.
        """
        try:
            _check_size(path)
            with np.load(path, allow_pickle=False) as file:
                count = sum(name.startswith("weight_") for name in file)
                pairs = [(file[f"weight_{i}"], file[f"bias_{i}"]) for i in range(count)]
                card = json.loads(str(file["card"]))
                parts = file["centre"], file["unit"], file["log_std"]
                return NumpyPolicy(pairs, *parts, card)
        except (KeyError, OSError, ValueError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path} is no policy of ours: {error}") from error


def _check_size(path: Path) -> None:
    """Refuse a file whose arrays would take too much memory, before there are any.

    Raises:
        ValueError: such a file, or one that holds something else.
    """
    total = 0
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as file:
                np.lib.format.read_magic(file)
                shape, _, dtype = np.lib.format.read_array_header_1_0(file)
            total += math.prod(shape) * dtype.itemsize
    if total > LARGEST:
        raise ValueError(f"its arrays take {total:,} bytes, more than {LARGEST:,}")
