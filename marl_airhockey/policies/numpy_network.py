"""Network with ReLU layers as NumPy arrays, in one small file."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

LARGEST = 64_000_000
"""Largest total size of the arrays of a file, bytes."""
MOST = 100
"""Largest number of arrays in a file."""
FEW_ROWS = 8
"""Largest number of inputs whose outputs are the same bits on every machine. Larger
batches use BLAS, which is faster and whose sums depend on the processor."""


@cache
def _blas() -> ThreadpoolController:
    """Return the controller of the threads of BLAS."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@dataclass(frozen=True, repr=False)
class NumpyNetwork:
    """Linear layers with ReLU between them, and a fixed scaling of the input.

    Each field of a subclass, except for the layers and the card, is an array of the
    file.

    Args:
        layers: Weights (out, in) and biases (out,) of each layer.
        centre: Centre (D,), which is subtracted from the input.
        unit: Scale (D,), by which the difference is divided.
        card: Scenario, settings and results of the training.
    """

    kind: ClassVar[str] = "network"
    """Name of the content of the file, for messages."""

    layers: Sequence[tuple[Array, Array]]
    centre: Array
    unit: Array
    card: Mapping[str, Any] = field(default_factory=dict, kw_only=True)

    def __repr__(self) -> str:
        sizes = [len(self.centre), *(len(bias) for _, bias in self.layers)]
        return f"{type(self).__name__}({' -> '.join(map(str, sizes))})"

    def forward(self, inputs: Array) -> Array:
        """Return the outputs (B, out) of the last layer for inputs (B, D)."""
        if inputs.shape[-1:] != self.centre.shape:
            raise ValueError(
                f"observations of shape (B, {len(self.centre)}) are expected, got "
                f"{inputs.shape}"
            )
        if len(inputs) <= FEW_ROWS:
            numbers, sizes = self._flat
            kind = np.result_type(inputs, numbers)
            out = np.empty((len(inputs), sizes[-1]), kind)
            work = np.empty((2, sizes.max()), kind)
            _forward(np.ascontiguousarray(inputs), numbers, sizes, out, work)
            return out
        # Threads of BLAS busy-wait for each other. For layers of this size they need
        # twice the CPU time on two cores, and more on more cores.
        with _blas().limit(limits=1, user_api="blas"):
            return self._by_blas(inputs)

    @cached_property
    def _flat(self) -> tuple[Array, Array]:
        """Numbers and sizes of all layers, as `_forward` reads them."""
        parts = [self.centre, self.unit]
        for weight, bias in self.layers:
            parts += [weight.T.reshape(-1), bias]
        sizes = [len(self.centre), *(len(bias) for _, bias in self.layers)]
        return np.concatenate(parts), np.array(sizes)

    def _by_blas(self, inputs: Array) -> Array:
        x = (inputs - self.centre) / self.unit
        for weight, bias in self.layers[:-1]:
            x = np.maximum(x @ weight.T + bias, 0.0)
        weight, bias = self.layers[-1]
        return np.asarray(x @ weight.T + bias)

    def save(self, path: Path) -> None:
        """Write an .npz that includes the card; the file is replaced atomically."""
        arrays: dict[str, Any] = {
            **{name: getattr(self, name) for name in self._names()},
            "card": np.array(json.dumps(dict(self.card))),
            **{f"weight_{i}": w for i, (w, _) in enumerate(self.layers)},
            **{f"bias_{i}": b for i, (_, b) in enumerate(self.layers)},
        }
        draft = path.with_name(f"part-{path.name}")
        np.savez_compressed(draft, **arrays)
        draft.replace(path)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a file that `save` wrote.

        Raises:
            ValueError: The file is of another kind.
        """
        try:
            arrays = _read(path)
            card = json.loads(str(arrays.pop("card")))
            count = sum(name.startswith("weight_") for name in arrays)
            pairs = [(arrays[f"weight_{i}"], arrays[f"bias_{i}"]) for i in range(count)]
            found = cls(pairs, *(arrays[name] for name in cls._names()), card=card)
            found._check()
        except KeyError as error:
            words = f"the array {error} is missing"
            raise ValueError(f"{path} is not a {cls.kind} file: {words}") from error
        except Exception as error:  # A broken or hostile file can raise any error.
            raise ValueError(f"{path} is not a {cls.kind} file: {error}") from error
        return found

    @classmethod
    def _names(cls) -> list[str]:
        """Return the names of the arrays other than those of layers, in field order."""
        return [f.name for f in fields(cls) if f.name not in ("layers", "card")]

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
        if not self.layers:
            raise ValueError("it has no layers")
        arrays = [getattr(self, name) for name in self._names()]
        arrays += sum(self.layers, ())
        if not all(a.dtype.kind == "f" and np.isfinite(a).all() for a in arrays):
            raise ValueError("every element must be a finite number")
        if (self.unit == 0.0).any():
            raise ValueError("a unit is 0")
        if not isinstance(self.card, Mapping):
            raise ValueError("its card is not an object")


@compiled(nogil=True, error_model="numpy")
def _forward(
    inputs: Array, numbers: Array, sizes: Array, out: Array, work: Array
) -> None:
    """Fill the outputs of a network, with all sums in the order of the inputs.

    Args:
        inputs: Inputs (B, D).
        numbers: Centre, unit, and for each layer weights (in, out) and biases, in one
            row.
        sizes: Number of inputs, and of outputs of each layer.
        out: Outputs (B, out), filled.
        work: Work space (2, n), where n is the largest size.
    """
    for b in range(len(inputs)):
        k, at = 0, 2 * sizes[0]
        for i in range(sizes[0]):
            work[0, i] = (inputs[b, i] - numbers[i]) / numbers[sizes[0] + i]
        for layer in range(1, len(sizes)):
            before, after = work[k], work[1 - k]
            n, m = sizes[layer - 1], sizes[layer]
            for o in range(m):
                after[o] = numbers[at + n * m + o]
            for i in range(n):
                # Half of the outputs of a layer are 0.
                if before[i] != 0.0:
                    for o in range(m):
                        after[o] += numbers[at + i * m + o] * before[i]
            at += n * m + m
            k = 1 - k
            for o in range(m):
                if layer + 1 < len(sizes):
                    if after[o] < 0.0:
                        after[o] = 0.0
                else:
                    out[b, o] = after[o]


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
