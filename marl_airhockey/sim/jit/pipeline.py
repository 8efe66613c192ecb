"""Pipeline: functions that are called one after the other on fixed arrays.

A call of compiled code from Python costs about 50 ns per array, and the allocation of
an array costs as much again. For one world, this is more than all the arithmetic.
Neighbouring compiled stages therefore become one compiled function, which finds its
arrays by address. Stages in plain Python run between them. The numbers are the same.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numba import carray, njit, types  # type: ignore[attr-defined]
from numba.core import cgutils
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic

from marl_airhockey.sim.jit.codegen import load
from marl_airhockey.sim.jit.threads import LEAST, over_rows
from marl_airhockey.types import Array


class Fixed(NamedTuple):
    """Array that all worlds share."""

    array: Array


class Stage(NamedTuple):
    """Function, and the arguments with which it is called in every step."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    """Arrays (B, *), `Fixed` arrays and numbers; any values for a Python function."""
    stops: bool = False
    """True if the function returns False to end the pipeline."""
    generated: bool = False
    """True for a loop that was generated for one scenario."""

    def __call__(self) -> bool:
        """Call the function; return False if the pipeline must end."""
        given = [a.array if isinstance(a, Fixed) else a for a in self.arguments]
        going = self.function(*given)
        return bool(going) if self.stops else True

    @property
    def compiled(self) -> bool:
        """True if numba compiles the function and MARL_AIRHOCKEY_COMPILE is not 0."""
        off = os.environ.get("MARL_AIRHOCKEY_COMPILE", "1") == "0"
        return isinstance(self.function, Dispatcher) and not off


@intrinsic
def pointer(_: Any, address: Any) -> Any:
    """Convert an address to the pointer that numba's `carray` takes."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), generate


@njit(inline="always")
def view(address: int, shape: Any, dtype: Any) -> Array:
    """Return the array at an address, without an owner; for compiled code only."""
    return carray(pointer(address), shape, dtype)  # type: ignore[call-arg]


class Pipeline:
    """Stages of a step, called in order.

    Args:
        rows: Number of worlds, B.
        stages: Stages of a step. Their arrays must not be reallocated.
        name: Subject of the announcement of a compilation.
    """

    def __init__(self, rows: int, stages: Sequence[Stage], name: str) -> None:
        self.parts: list[Stage | CompiledPart] = []
        # Generated loops are compiled separately, so similar scenes share other code.
        for (compiled, _), group in groupby(stages, _kind):
            part = list(group)
            if compiled:
                self.parts.append(CompiledPart(rows, part, name))
            else:
                self.parts.extend(part)

    def __call__(self) -> bool:
        """Call the stages in order; return False and skip the rest if one stops."""
        # A generator would cost more than the calls.
        for part in self.parts:  # noqa: SIM110
            if not part():
                return False
        return True


def _kind(stage: Stage) -> tuple[bool, bool]:
    return stage.compiled, stage.generated


class CompiledPart:
    """Stages as one compiled function. Several threads can share its rows."""

    def __init__(self, rows: int, stages: Sequence[Stage], name: str) -> None:
        inputs = _Inputs()
        source = _source(stages, inputs)
        self._rows = rows
        self.where = np.array(inputs.values, np.int64)
        """Addresses and lengths of arrays, the argument of the function."""
        self.arrays = inputs.arrays
        """Arrays by the index of their address in ``where``."""
        self._strides = np.array(inputs.strides, np.int64)
        self.shared = {
            inputs.values[k]
            for k, array in self.arrays.items()
            # An empty array can have the address of another one.
            if array.size and not inputs.strides[k]
        }
        """Addresses of the arrays that all worlds share."""
        functions: dict[str, Any] = {"pointer": pointer}
        functions |= {f"f{i}": stage.function for i, stage in enumerate(stages)}
        self.kernel: Any = load(source, name, functions).kernel
        """Compiled function of ``where`` and the number of rows."""

    def __call__(self) -> bool:
        if self._rows < 2 * LEAST:
            return bool(self.kernel(self.where, self._rows))
        going: list[bool] = []

        def work(rows: slice) -> None:
            first, end, _ = rows.indices(self._rows)
            where = self.where + first * self._strides
            going.append(bool(self.kernel(where, end - first)))

        over_rows(work, self._rows)
        return all(going)


class _Inputs:
    """Integers that a pipeline's function reads: addresses and lengths of its arrays.

    They are not part of its source, so scenes of different sizes share compiled code.
    """

    def __init__(self) -> None:
        self.values: list[int] = []
        self.strides: list[int] = []
        """Increase of each value from one world to the next."""
        self.arrays: dict[int, Array] = {}
        """Arrays by the index of their address; stored so that they stay there."""

    def array(self, array: Array, shared: bool) -> str:
        """Return the expression of an array, whose rows are worlds unless shared."""
        assert array.flags.c_contiguous, "rows must be contiguous"
        self.arrays[len(self.values)] = array
        address = self.number(array.ctypes.data, 0 if shared else array.strides[0])
        axes = [self.number(length) for length in array.shape[not shared :]]
        shape = ", ".join(axes if shared else ["n", *axes])
        kind = "bool_" if array.dtype == np.bool_ else array.dtype.name
        return f"carray(pointer({address}), ({shape},), np.{kind})"

    def number(self, value: int, stride: int = 0) -> str:
        """Return the expression of an integer."""
        self.values.append(value)
        self.strides.append(stride)
        return f"where[{len(self.values) - 1}]"


def _source(stages: Sequence[Stage], inputs: _Inputs) -> str:
    """Return the source of a pipeline, the same for all sizes, and list its inputs."""
    views: list[str] = []
    calls: list[str] = []
    for i, stage in enumerate(stages):
        names = []
        for argument in stage.arguments:
            array = argument.array if isinstance(argument, Fixed) else argument
            if isinstance(array, np.ndarray):
                names.append(f"a{len(views)}")
                found = inputs.array(array, shared=array is not argument)
                views.append(f"{names[-1]} = {found}")
            elif type(array) is int:
                names.append(inputs.number(array))
            else:
                names.append(repr(array))
        call = f"f{i}({', '.join(names)})"
        calls += [f"if not {call}:", "    return False"] if stage.stops else [call]
    lines = [
        '"""Written by marl_airhockey.sim.jit.pipeline."""',
        *(f"# f{i}: {_called(stage.function)}" for i, stage in enumerate(stages)),
        "import numpy as np",
        "from numba import carray",
        "SIGNATURE = 'boolean(int64[::1], int64)'",
        "def kernel(where, n):",
        *(f"    {line}" for line in [*views, *calls]),
        "    return True",
    ]
    return "\n".join(lines) + "\n"


def _called(function: Any) -> str:
    return f"{function.py_func.__module__}.{function.py_func.__qualname__}"
