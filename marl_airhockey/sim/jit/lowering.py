"""Lowering: translates recorded operations to a loop over worlds in LLVM.

Numba needs 7 ms for each line of Python that it compiles, and several times as much in
functions of thousands of lines. Its translation of a single operation on scalars takes
a small part of this time. A loop is therefore not written in Python. Numba's own rules
type and translate each operation, as they do for a line of Python.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import from_dtype, typeof, types
from numba.core import cgutils
from numba.core.errors import NumbaError
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from marl_airhockey.sim.jit.elementary import ELEMENTARY

Argument = int | tuple[Any]
"""Index of an earlier operation, or a number in a tuple."""
Operation = tuple[Any, ...]
"""Name of a NumPy function and its arguments; or "input", the index of an array, and
the index of an element in a row of it."""
Store = tuple[int, int, Argument]
"""Index of an array, index of an element in a row of it, and stored value."""

OPERATORS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "less": operator.lt,
    "less_equal": operator.le,
    "greater": operator.gt,
    "greater_equal": operator.ge,
    "equal": operator.eq,
    "not_equal": operator.ne,
    "bitwise_and": operator.and_,
    "bitwise_or": operator.or_,
}
"""Operations for which numba has faster rules than for NumPy's functions."""
COMPARED = {"maximum": operator.lt, "minimum": operator.gt}
"""Comparisons of a value with a known number. Where they are true, the number is the
result."""


class Value(NamedTuple):
    """LLVM value and its type."""

    type: Any
    llvm: Any


def loop(
    sizes: Sequence[int], operations: Sequence[Operation], stores: Sequence[Store]
) -> Any:
    """Return a function of a tuple of arrays (B, *), for compiled code only.

    Args:
        sizes: Number of elements in a row of each array.
        operations: Operations on one world, in order.
        stores: Values that are stored after the operations.
    """

    @intrinsic
    def run(_: Any, arrays: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            made = [make_array(kind) for kind in signature.args[0].types]  # type: ignore[no-untyped-call]
            views = [
                make(context, builder, builder.extract_value(args[0], k))
                for k, make in enumerate(made)
            ]
            kinds = [kind.dtype for kind in signature.args[0].types]
            rows = builder.extract_value(views[0].shape, 0)
            with cgutils.for_range(builder, rows) as world:
                row = _Row(context, builder, views, kinds, sizes, world.index)
                for name, *given in operations:
                    row.apply(name, given)
                for array, element, what in stores:
                    row.store(array, element, what)
            return context.get_dummy_value()

        return types.none(arrays), generate

    return run


class _Row:
    """Row of one world: its elements and the values that are computed from them."""

    def __init__(
        self,
        context: Any,
        builder: Any,
        views: list[Any],
        kinds: list[Any],
        sizes: Sequence[int],
        world: Any,
    ) -> None:
        self._context, self._builder = context, builder
        self._kinds, self._values = kinds, list[Value]()
        self._rows = [
            builder.gep(view.data, [builder.mul(world, world.type(size))])
            for view, size in zip(views, sizes, strict=True)
        ]
        self._known: dict[Any, tuple[Any, Any]] = {}
        """Signatures and translations by function and types."""

    def apply(self, name: str, given: Sequence[Any]) -> None:
        """Append the value of an operation."""
        if name == "input":
            array, element = given
            kind = self._kinds[array]
            value = self._context.unpack_value(
                self._builder, kind, self._at(array, element)
            )
            self._values.append(Value(kind, value))
            return
        args = [self._value(a) for a in given]
        truths = all(a.type == types.boolean for a in args)
        if name == "where":
            done = self._select(*args)
        elif name == "invert" and truths:
            done = self._call(operator.not_, *args)
        elif name in COMPARED and isinstance(given[1], tuple):
            # Same results as np.maximum and np.minimum, also for nan, but faster.
            condition = self._call(COMPARED[name], *args)
            done = self._select(condition, args[1], args[0])
        elif name in OPERATORS and not (truths and name in ("add", "multiply")):
            done = self._call(OPERATORS[name], *args)
        elif name in ELEMENTARY:
            done = self._call(ELEMENTARY[name], *args)
        elif isinstance(getattr(np, name), np.ufunc):
            done = self._call(getattr(np, name), *args)
        else:
            done = self._cast(args[0], from_dtype(np.dtype(name)))
        self._values.append(done)

    def store(self, array: int, element: int, what: Argument) -> None:
        """Store a value in an array."""
        kind = self._kinds[array]
        value = self._cast(self._value(what), kind).llvm
        self._context.pack_value(self._builder, kind, value, self._at(array, element))

    def _at(self, array: int, element: int) -> Any:
        """Return the address of an element."""
        return cgutils.gep(self._builder, self._rows[array], element)  # type: ignore[no-untyped-call]

    def _value(self, argument: Argument) -> Value:
        if isinstance(argument, int):
            return self._values[argument]
        kind = typeof(argument[0])  # type: ignore[no-untyped-call]
        return Value(kind, self._context.get_constant(kind, argument[0]))

    def _cast(self, value: Value, kind: Any) -> Value:
        cast = self._context.cast
        return Value(kind, cast(self._builder, value.llvm, value.type, kind))

    def _select(self, condition: Value, yes: Value, no: Value) -> Value:
        kind = self._context.typing_context.unify_types(yes.type, no.type)
        values = (self._cast(value, kind).llvm for value in (yes, no))
        truth = self._cast(condition, types.boolean).llvm
        return Value(kind, self._builder.select(truth, *values))

    def _call(self, function: Any, *args: Value) -> Value:
        """Apply a function to values by numba's rules."""
        key = function, *(a.type for a in args)
        if key not in self._known:
            typing = self._context.typing_context
            try:
                kind = typing.resolve_value_type(function)
                signature = typing.resolve_function_type(kind, key[1:], {})
            except (ValueError, NumbaError):
                signature = None
            if signature is None:
                kinds = ", ".join(map(str, key[1:]))
                raise TypeError(f"numba has no {function.__name__} of {kinds}")
            self._known[key] = signature, self._context.get_function(kind, signature)
        signature, translate = self._known[key]
        given = zip(args, signature.args, strict=True)
        values = [self._cast(value, kind).llvm for value, kind in given]
        # The functions of `elementary` are linked, those of numba have no libraries.
        for library in getattr(translate, "libs", ()):
            self._context.active_code_library.add_linking_library(library)
        return Value(signature.return_type, translate(self._builder, values))
