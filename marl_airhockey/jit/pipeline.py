"""Compiled functions called one after the other, by one call, on arrays that stay.

Calling compiled code from Python costs some 50 ns for every array, and making an array
as much again: for one world, that is more than all the arithmetic. A chain looks up the
addresses of its arrays once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from marl_airhockey.jit.codegen import load
from marl_airhockey.types import Array


class NotCompilable(Exception):
    """Why something is no stage of a chain."""


class Fixed(NamedTuple):
    """An array that all worlds share."""

    array: Array


class Stage(NamedTuple):
    """A compiled function, and what it is called with."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    """Arrays (B, *), `Fixed` ones, and numbers"""
    stops: bool = False
    """Whether it returns False where the chain must end"""


@intrinsic
def pointer(_: Any, address: Any) -> Any:
    """An address, as numba's `carray` takes it."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), generate


class Pipeline:
    """Stages as one compiled function.

    Args:
        rows: B.
        turns: lists of stages that differ in nothing but their arrays; a call takes
            one of them.
    """

    def __init__(self, rows: int, *turns: Sequence[Stage]) -> None:
        self._rows, self._turns = rows, turns
        """Turns are kept, as the tables hold the addresses of their arrays."""
        self._tables = [
            np.array([array.ctypes.data for array in _arrays(stages)], np.int64)
            for stages in turns
        ]
        functions = {f"f{i}": stage.function for i, stage in enumerate(turns[0])}
        self._kernel = load(_source(turns[0]), functions).kernel

    def __call__(self, turn: int) -> bool:
        """Call all stages of a turn, or those up to one that stops it: False."""
        return bool(self._kernel(self._tables[turn], self._rows))


def _arrays(stages: Sequence[Stage]) -> Iterator[Array]:
    """The arrays of all arguments."""
    for stage in stages:
        for argument in stage.arguments:
            array = argument.array if isinstance(argument, Fixed) else argument
            if isinstance(array, np.ndarray):
                assert array.flags.c_contiguous, "rows must lie one behind the other"
                yield array


def _source(stages: Sequence[Stage]) -> str:
    """The module of a chain, the same for any number of worlds."""
    views: list[str] = []
    calls: list[str] = []
    for i, stage in enumerate(stages):
        names = []
        for argument in stage.arguments:
            array = argument.array if isinstance(argument, Fixed) else argument
            if not isinstance(array, np.ndarray):
                names.append(repr(array))
                continue
            k, axes = len(views), [str(length) for length in array.shape]
            if array is argument:
                axes[0] = "n"
            kind = "bool_" if array.dtype == np.bool_ else array.dtype.name
            shape = f"({', '.join(axes)},)"
            views.append(f"a{k} = carray(pointer(where[{k}]), {shape}, np.{kind})")
            names.append(f"a{k}")
        call = f"f{i}({', '.join(names)})"
        calls += [f"if not {call}:", "    return False"] if stage.stops else [call]
    lines = [
        '"""Written by marl_airhockey.jit.pipeline; may be deleted at any time."""',
        f"# {_version()}",
        *(f"# f{i}: {_called(stage.function)}" for i, stage in enumerate(stages)),
        "import numpy as np",
        "from numba import carray",
        "from marl_airhockey.jit.pipeline import pointer",
        "SIGNATURE = 'boolean(int64[::1], int64)'",
        "def kernel(where, n):",
        *(f"    {line}" for line in [*views, *calls]),
        "    return True",
    ]
    return "\n".join(lines) + "\n"


def _called(function: Any) -> str:
    return f"{function.py_func.__module__}.{function.py_func.__qualname__}"


@cache
def _version() -> str:
    """Of the package's sources: what numba keeps of a chain holds their code."""
    files = sorted(Path(__file__).parents[1].rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
