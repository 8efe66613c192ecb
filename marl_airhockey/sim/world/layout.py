"""Layout: the arrays of a world's control step as one block of memory.

Code for another machine (`jit.targets`) reads and writes the same arrays. They are
packed into one image, together with the tables from which each function reads where its
arrays are. A machine copies the image to an address and adds the address to all words
that are offsets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.sim.jit.pipeline import CompiledPart
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

ALIGNMENT = 16
"""Alignment of arrays in the image, bytes."""


class Call(NamedTuple):
    """Call of a function in a control step."""

    part: int
    """Index of the function in `Layout.parts`."""
    table: int
    """Offset of its table in the image."""
    length: int
    """Number of 64-bit words of the table."""


class Layout(NamedTuple):
    """Arrays and functions of a control step."""

    image: bytes
    """Initial values of all arrays, and the tables of the functions."""
    offsets: list[int]
    """Positions of the 64-bit words in the image that are offsets in it."""
    arrays: dict[str, dict[str, Any]]
    """``offset``, ``shape`` and ``dtype`` of each named array. Moment 0 is the current
    one of a new episode."""
    steps: list[list[Call]]
    """Calls of the step from moment 0 to moment 1, and of the step back."""
    parts: list[CompiledPart]
    """Functions."""


def layout_of(world: World) -> Layout:
    """Return the layout of a world, of which an episode has begun.

    Raises:
        ValueError: There are several worlds, or a function of the control step is not
            compiled.
    """
    step = world.control_step
    if world.num_worlds != 1:
        raise ValueError(f"num_worlds: {world.num_worlds}; a layout has one world")
    steps, parts = [], dict[int, CompiledPart]()
    for pipeline in step.pipelines:
        for part in pipeline.parts:
            if not isinstance(part, CompiledPart):
                raise ValueError(
                    f"{world.scenario.name}: a function of the control step is not "
                    f"compiled: {world.referee.refused or part.function}"
                )
            parts.setdefault(id(part.kernel), part)
    first = step.moments[step.current], step.moments[1 - step.current]
    names = {
        array.ctypes.data: name
        for root, value in (
            ("backend", vars(world.backend)),
            *(("inputs", step.inputs), ("moment_0", first[0]), ("moment_1", first[1])),
        )
        for name, array in _arrays(root, value)
    }
    blocks = _Blocks([a for p in step.pipelines for q in p.parts for a in _of(q)])
    order = list(parts)
    # The current moment is moment 0, so its pipeline is the first one.
    for k in (step.current, 1 - step.current):
        steps.append(
            [
                Call(order.index(id(part.kernel)), *blocks.add_table(part))
                for part in step.pipelines[k].parts
                if isinstance(part, CompiledPart)
            ]
        )
    arrays = {
        names.get(address, f"constant_{k}"): blocks.entry(array)
        for k, (address, array) in enumerate(sorted(blocks.arrays.items()))
    }
    return Layout(bytes(blocks.image), blocks.offsets, arrays, steps, [*parts.values()])


def _of(part: Any) -> Iterator[Array]:
    yield from part.arrays.values()


def _arrays(name: str, value: Any) -> Iterator[tuple[str, Array]]:
    """Yield the arrays in tuples, mappings and dataclasses with their names."""
    inside: Mapping[str, Any] = {}
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, Mapping):
        inside = value
    elif is_dataclass(value):
        inside = {f.name: getattr(value, f.name) for f in fields(value)}
    elif hasattr(value, "_asdict"):
        inside = value._asdict()
    elif isinstance(value, tuple):
        inside = {str(k): item for k, item in enumerate(value)}
    for key, item in inside.items():
        yield from _arrays(f"{name}.{str(key).removeprefix('_')}", item)


class _Blocks:
    """Image of arrays; arrays that overlap keep their distance."""

    def __init__(self, arrays: list[Array]) -> None:
        self.arrays = {a.ctypes.data: a for a in sorted(arrays, key=_size)}
        self.image, self.offsets = bytearray(), list[int]()
        self._starts: list[tuple[int, int]] = []
        """Address and offset of each array, by address."""
        end, shift = 0, 0
        for address, array in sorted(self.arrays.items()):
            if address >= end:
                self._align()
                shift = len(self.image) - address
            self._starts.append((address, address + shift))
            end = max(end, address + array.nbytes)
            data = array.tobytes()[len(self.image) - address - shift :]
            self.image += data

    def entry(self, array: Array) -> dict[str, Any]:
        """Return offset, shape and dtype of an array."""
        offset = self.offset(array.ctypes.data)
        return {"offset": offset, "shape": array.shape, "dtype": array.dtype.name}

    def offset(self, address: int) -> int:
        """Return the offset of an array, given its address."""
        return dict(self._starts)[address]

    def add_table(self, part: CompiledPart) -> tuple[int, int]:
        """Append the table of a function; return its offset and length."""
        self._align()
        table = part.where.copy()
        at = len(self.image)
        for index, array in part.arrays.items():
            table[index] = self.offset(array.ctypes.data)
            self.offsets.append(at + 8 * index)
        self.image += table.tobytes()
        return at, len(table)

    def _align(self) -> None:
        self.image += bytes(-len(self.image) % ALIGNMENT)


def _size(array: Array) -> int:
    return array.nbytes
