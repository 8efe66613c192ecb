"""NumPy policy: a learned network as plain arrays, in one small file."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from marl_airhockey.types import Array

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

LARGEST = 64_000_000
"""Largest number of bytes that the arrays of a file may take."""
MOST = 100
"""Largest number of arrays in a file."""
FEW_ROWS = 8
"""Number of observations for which BLAS takes one thread anyway"""


@cache
def _blas() -> ThreadpoolController:
    """Return the controller of the threads of BLAS."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@dataclass(frozen=True)
class NumpyPolicy:
    """Network with ReLU layers that returns the mean action.

    Args:
        layers: Weights (out, in) and biases (out,) of each layer.
        centre: Centre (D,), subtracted from the observation.
        unit: Divisor (D,) of the difference.
        log_std: Log standard deviation (2,) of the action noise in training.
        card: Scenario and its version, settings and results of the training; with
            "bounded", the hyperbolic tangent follows the last layer.
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
        if len(observation) <= FEW_ROWS:
            return self._forward(observation)
        # Threads of BLAS busy-wait for each other: for layers as small as these they
        # cost twice the CPU time on two cores, and more on more cores.
        with _blas().limit(limits=1, user_api="blas"):
            return self._forward(observation)

    def _forward(self, observation: Array) -> Array:
        if observation.shape[-1:] != self.centre.shape:
            raise ValueError(
                f"observations of shape (B, {len(self.centre)}) are expected, got "
                f"{observation.shape}"
            )
        x = (observation - self.centre) / self.unit
        for weight, bias in self.layers[:-1]:
            x = np.maximum(x @ weight.T + bias, 0.0)
        weight, bias = self.layers[-1]
        action = x @ weight.T + bias
        return np.asarray(np.tanh(action) if self.card.get("bounded") else action)

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
            ValueError: A file of another kind.
        """
        try:
            arrays = _read(path)
            card = json.loads(str(arrays.pop("card")))
            count = sum(name.startswith("weight_") for name in arrays)
            pairs = [(arrays[f"weight_{i}"], arrays[f"bias_{i}"]) for i in range(count)]
            parts = arrays["centre"], arrays["unit"], arrays["log_std"]
            found = NumpyPolicy(pairs, *parts, card)
            found._check()
        except KeyError as error:
            words = f"the array {error} is missing"
            raise ValueError(f"{path} is no policy of ours: {words}") from error
        except Exception as error:  # Whatever a broken or hostile file makes of it.
            raise ValueError(f"{path} is no policy of ours: {error}") from error
        return found

    def _check(self) -> None:
        """Refuse layers whose shapes do not match, and elements that are no number.

        Raises:
            ValueError: One of these, named.
        """
        size = self.centre.size
        if self.centre.shape != (size,) or self.unit.shape != (size,):
            raise ValueError("centre and unit must be (D,)")
        for weight, bias in self.layers:
            if weight.shape != (len(bias), size) or bias.ndim != 1:
                raise ValueError(f"a layer of {weight.shape} follows {size} numbers")
            size = len(bias)
        if size != 2 or self.log_std.shape != (2,) or not self.layers:
            raise ValueError("its actions are not (2,)")
        arrays = [self.centre, self.unit, self.log_std, *sum(self.layers, ())]
        if not all(a.dtype.kind == "f" and np.isfinite(a).all() for a in arrays):
            raise ValueError("every element must be a finite number")
        if not isinstance(self.card, Mapping):
            raise ValueError("its card is no object")
        observe = self.card.get("observe")
        if (self.unit == 0.0).any() or not isinstance(observe, (str, type(None))):
            raise ValueError("a unit is 0, or `observe` is no text")


def _read(path: Path) -> dict[str, Array]:
    """Read the arrays of an .npz, of numbers or text, with no more memory than that.

    Raises:
        ValueError: Too large, or other contents than arrays of numbers or text.
    """
    arrays: dict[str, Array] = {}
    with path.open("rb") as file:
        if file.read(4) != b"PK\x03\x04":
            raise ValueError("it is no .npz")
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        total = sum(member.file_size for member in members)
        if total > LARGEST or len(members) > MOST:
            raise ValueError(f"{len(members)} arrays of {total:,} bytes are too much")
        for member in members:
            content = io.BytesIO(archive.read(member))
            if np.lib.format.read_magic(content) != (1, 0):
                raise ValueError(f"{member.filename}: another version of the format")
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(content)
            rest = content.read()
            if dtype.kind not in "fU" or min(shape, default=0) < 0:
                raise ValueError(f"{member.filename}: {dtype} {shape}")
            if math.prod(shape) * dtype.itemsize != len(rest):
                raise ValueError(f"{member.filename}: {shape} in {len(rest)} bytes")
            flat = np.frombuffer(rest, dtype)
            order: Literal["F", "C"] = "F" if fortran else "C"
            name = member.filename.removesuffix(".npy")
            arrays[name] = flat.reshape(shape, order=order)
    return arrays
