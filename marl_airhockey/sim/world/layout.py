"""Layout: the arrays of a world's control step as one block of memory.

Code for another machine (`jit.targets`) reads and writes the same arrays. They are
packed into one image, together with the tables from which each function reads where its
arrays are. A machine copies the image to an address and adds the address to all words
that are offsets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.sim.jit.pipeline import CompiledPart, Pipeline, Stage
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

ALIGNMENT = 16
"""Alignment of arrays in the image, bytes."""


class Extra(NamedTuple):
    """Function in addition to the control step, such as a serve."""

    name: str
    stage: Stage
    arrays: Mapping[str, Array]
    """Arrays of its own by name."""


class Call(NamedTuple):
    """Call of a function."""

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
    """``offset``, ``shape`` and ``dtype`` of each named array, and ``shared`` if it is
    that of all worlds. Moment 0 is the current one of a new episode."""
    calls: dict[str, list[Call]]
    """Calls by name: "step_0" from moment 0 to moment 1, "step_1" back, and extras."""
    parts: list[CompiledPart]
    """Functions."""


def layout_of(world: World, extras: Sequence[Extra] = ()) -> Layout:
    """Return the layout of a world, of which an episode has begun.

    Args:
        world: One world.
        extras: Functions in addition to the control step.

    Raises:
        ValueError: There are several worlds, or a function is not compiled.
    """
    if world.num_worlds != 1:
        raise ValueError(f"num_worlds: {world.num_worlds}; a layout has one world")
    step = world.control_step
    order = step.current, 1 - step.current
    pipelines = {f"step_{n}": step.pipelines[k] for n, k in enumerate(order)}
    for extra in extras:
        pipelines[extra.name] = Pipeline(1, [extra.stage], world.scenario.name)
    parts = {name: _compiled(world, row) for name, row in pipelines.items()}
    every = [part for row in parts.values() for part in row]
    blocks = _Blocks([x for part in every for x in part.arrays.values()])
    functions: dict[int, CompiledPart] = {}
    for part in every:
        functions.setdefault(id(part.kernel), part)
    indices = {kernel: k for k, kernel in enumerate(functions)}
    calls = {
        name: [Call(indices[id(part.kernel)], *blocks.add_table(part)) for part in row]
        for name, row in parts.items()
    }
    roots = [("backend", vars(world.backend)), ("inputs", step.inputs)]
    roots += [(f"moment_{n}", step.moments[k]) for n, k in enumerate(order)]
    roots += [(extra.name, extra.arrays) for extra in extras]
    # Of several names of an array, the last one is used.
    names = {a.ctypes.data: name for root in roots for name, a in _arrays(*root)}
    alike = {a for part in every for a in part.shared}
    arrays = {
        names.get(address, f"constant_{k}"): blocks.entry(array)
        | ({"shared": True} if address in alike else {})
        for k, (address, array) in enumerate(sorted(blocks.arrays.items()))
    }
    used = list(functions.values())
    return Layout(bytes(blocks.image), blocks.offsets, arrays, calls, used)


def _compiled(world: World, pipeline: Pipeline) -> list[CompiledPart]:
    """Return the parts of a pipeline, which must be compiled."""
    found = []
    for part in pipeline.parts:
        if not isinstance(part, CompiledPart):
            raise ValueError(
                f"{world.scenario.name}: a function is not compiled: "
                f"{world.referee.refused or part.function}"
            )
        found.append(part)
    return found


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
        self.arrays = {a.ctypes.data: a for a in sorted(arrays, key=lambda a: a.nbytes)}
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
