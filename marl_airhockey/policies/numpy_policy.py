"""Learned network as NumPy arrays, in one small file."""

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
"""Largest total size of the arrays of a file, bytes."""
MOST = 100
"""Largest number of arrays in a file."""
FEW_ROWS = 8
"""Largest number of observations for which BLAS uses one thread anyway."""


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
        centre: Centre (D,), which is subtracted from the observation.
        unit: Scale (D,), by which the difference is divided.
        log_std: Logarithm of the standard deviation (2,) of the action noise in
            training.
        card: Scenario and its version, settings and results of the training. With the
            entry "bounded", tanh is applied to the output of the last layer.
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

        In a dictionary, the achieved and the desired goal follow the observation.
        """
        if isinstance(observation, Mapping):
            parts = ("observation", "achieved_goal", "desired_goal")
            observation = np.concatenate([observation[part] for part in parts], -1)
        if len(observation) <= FEW_ROWS:
            return self._forward(observation)
        # Threads of BLAS busy-wait for each other. For layers of this size they need
        # twice the CPU time on two cores, and more on more cores.
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
            ValueError: The file is of another kind.
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
            raise ValueError(f"{path} is not a policy file: {words}") from error
        except Exception as error:  # A broken or hostile file can raise any error.
            raise ValueError(f"{path} is not a policy file: {error}") from error
        return found

    def _check(self) -> None:
        """Check that the shapes of layers match and that elements are finite.

        Raises:
            ValueError: A check fails. The message names it.
        """
        size = self.centre.size
        if self.centre.shape != (size,) or self.unit.shape != (size,):
            raise ValueError("centre and unit must be (D,)")
        for weight, bias in self.layers:
            if weight.shape != (len(bias), size) or bias.ndim != 1:
                raise ValueError(f"layer of shape {weight.shape} after {size} numbers")
            size = len(bias)
        if size != 2 or self.log_std.shape != (2,) or not self.layers:
            raise ValueError("its actions do not have the shape (2,)")
        arrays = [self.centre, self.unit, self.log_std, *sum(self.layers, ())]
        if not all(a.dtype.kind == "f" and np.isfinite(a).all() for a in arrays):
            raise ValueError("every element must be a finite number")
        if not isinstance(self.card, Mapping):
            raise ValueError("its card is not an object")
        observe = self.card.get("observe")
        if (self.unit == 0.0).any() or not isinstance(observe, (str, type(None))):
            raise ValueError("a unit is 0, or `observe` is not a text")


def _read(path: Path) -> dict[str, Array]:
    """Read the arrays of an .npz, in no more memory than they need.

    Raises:
        ValueError: The file is too large, or contains anything except arrays of numbers
            or text.
    """
    arrays: dict[str, Array] = {}
    with path.open("rb") as file:
        if file.read(4) != b"PK\x03\x04":
            raise ValueError("it is not an .npz file")
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        total = sum(member.file_size for member in members)
        if total > LARGEST or len(members) > MOST:
            raise ValueError(f"{len(members)} arrays of {total:,} bytes are too large")
        for member in members:
            content = io.BytesIO(archive.read(member))
            if np.lib.format.read_magic(content) != (1, 0):
                raise ValueError(f"{member.filename}: unknown version of the format")
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
