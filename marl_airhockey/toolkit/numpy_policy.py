"""NumPy policy: a learned network as plain arrays, in one small file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.types import Array


@dataclass(frozen=True)
class NumpyPolicy:
    """Network of rectified layers that gives the mean action.

    Args:
        layers: (out, in) weights and (out,) biases of each layer.
        centre: (D,) taken off the observation.
        unit: (D,) that it is divided by then.
        log_std: (2,) of the action noise in training.
        card: scenario and its version, how it was trained, how good it is.
    """

    layers: Sequence[tuple[Array, Array]]
    centre: Array
    unit: Array
    log_std: Array
    card: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, observation: Array, deterministic: bool = True) -> Array:
        """Return (B, 2) mean actions for observations (B, D); noise is the driver's."""
        x = (observation - self.centre) / self.unit
        for weight, bias in self.layers[:-1]:
            x = np.maximum(x @ weight.T + bias, 0.0)
        weight, bias = self.layers[-1]
        return np.asarray(x @ weight.T + bias)

    def save(self, path: Path) -> None:
        """Write an .npz with the card in it; a kill leaves the old file or the new."""
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
            ValueError: not such a file.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                count = sum(name.startswith("weight_") for name in file)
                pairs = [(file[f"weight_{i}"], file[f"bias_{i}"]) for i in range(count)]
                card = json.loads(str(file["card"]))
                parts = file["centre"], file["unit"], file["log_std"]
                return NumpyPolicy(pairs, *parts, card)
        except (KeyError, OSError, ValueError) as error:
            raise ValueError(f"{path} is no policy of ours: {error}") from error
