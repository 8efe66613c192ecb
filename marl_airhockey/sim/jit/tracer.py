"""Tracer: records the arithmetic of one world while NumPy code runs on its symbols.

An array of symbols is an object array. NumPy itself indexes, broadcasts and stacks it.
Only arithmetic is recorded, element by element.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import numpy as np

from marl_airhockey.sim.jit.elementary import ELEMENTARY
from marl_airhockey.types import Array

Scalar = Any
"""Symbol, or a number that is known while tracing."""


class Untraceable(Exception):
    """Error for control flow that depends on traced values, or calls without a rule."""


class Symbol(np.lib.mixins.NDArrayOperatorsMixin):
    """Scalar of one world: an operation on other symbols, and its value in a sample."""

    __slots__ = ("args", "op", "tape", "value")
    __hash__ = object.__hash__

    def __init__(self, tape: Tape, op: str, args: tuple[Scalar, ...], value: Any):
        self.tape, self.op, self.args, self.value = tape, op, args, value

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: Any, **_: Any
    ) -> Any:
        if method != "__call__" or any(np.ndim(x) for x in inputs):
            return NotImplemented
        plain = [x.item() if isinstance(x, np.ndarray) else x for x in inputs]
        return _apply(ufunc.__name__, ufunc, *plain)

    def __bool__(self) -> bool:
        raise Untraceable("it branches on a number that differs by world")

    def __float__(self) -> float:
        raise Untraceable("it converts a number that differs by world into a float")

    __int__ = __index__ = __float__


class Tape:
    """Symbols of a trace, in the order of creation. Each operation appears once."""

    def __init__(self) -> None:
        self.symbols: dict[Any, Symbol] = {}

    def record(self, op: str, args: tuple[Scalar, ...], value: Any) -> Symbol:
        """Return the symbol of an operation."""
        key = (op, *(a if isinstance(a, Symbol) else (type(a), repr(a)) for a in args))
        if key not in self.symbols:
            self.symbols[key] = Symbol(self, op, args, value)
        return self.symbols[key]

    def array(self, name: tuple[int, str], sample: Array) -> Symbols:
        """Return the symbols of an input of one world, with the values of a sample."""
        out = np.empty(sample.shape, object)
        for index in np.ndindex(sample.shape):
            value = sample[index]
            out[index] = self.record("input", (name, index), value)
        return out.view(Symbols)


def _apply(op: str, function: Callable[..., Any], *args: Scalar) -> Scalar:
    """Apply an operation to scalars; return a number if all are known, or a symbol."""
    values = [a.value if isinstance(a, Symbol) else a for a in args]
    function = ELEMENTARY.get(op, function)
    with np.errstate(all="ignore"):
        value = np.asarray(function(*values))[()]
    for arg in args:
        if isinstance(arg, Symbol):
            return arg.tape.record(op, args, value)
    return value.item()


def _each(op: str, function: Callable[..., Any], arrays: Sequence[Any]) -> Symbols:
    """Apply an operation to arrays, element by element, with numpy's broadcasting."""

    def one(*args: Scalar) -> Scalar:
        return _apply(op, function, *args)

    # Base-class arrays, or numpy would recurse into this function.
    plain = [np.asarray(a).astype(object) for a in arrays]
    done = np.frompyfunc(one, len(plain), 1)(*plain)
    out = np.empty(np.shape(done), object)
    out[...] = done
    return out.view(Symbols)


def _where(condition: Any, yes: Any, no: Any) -> Symbols:
    return _each("where", np.where, (condition, yes, no))


def _clip(x: Any, low: Any, high: Any) -> Symbols:
    raised = _each("maximum", np.maximum, (x, low))
    return _each("minimum", np.minimum, (raised, high))


def _matmul(a: Any, b: Any) -> Any:
    """Multiply matrices without the terms of known zeros, as rotations have many.

    If the other factor of such a term is infinite, NumPy would return nan.
    """
    a, b = (np.asarray(x).astype(object) for x in (a, b))
    columns = np.swapaxes(b, -1, -2)[..., None, :, :]
    left, right = np.broadcast_arrays(a[..., :, None, :], columns)
    out = np.empty(left.shape[:-1], object)
    for index in np.ndindex(out.shape):
        pairs = zip(left[index], right[index], strict=True)
        some = [p for p in pairs if not any(_is_zero(x) for x in p)]
        terms = [_apply("multiply", np.multiply, x, y) for x, y in some]
        out[index] = reduce(lambda x, y: _apply("add", np.add, x, y), terms or [0.0])
    return out.view(Symbols)


def _is_zero(scalar: Scalar) -> bool:
    return not isinstance(scalar, Symbol) and bool(scalar == 0)


def _zeros_like(a: Any) -> Array:
    return np.zeros(np.shape(a))


def _full_like(a: Any, value: float) -> Array:
    return np.full(np.shape(a), value)


SPECIAL: dict[Any, Callable[..., Any]] = {
    np.where: _where,
    np.clip: _clip,
    np.matmul: _matmul,
    np.zeros_like: _zeros_like,
    np.full_like: _full_like,
}
"""Rules for NumPy functions that do not work element by element."""


class Symbols(np.ndarray[Any, Any]):
    """Object array of symbols and known numbers that records operations."""

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any
    ) -> Any:
        (out,) = options.pop("out", None) or (None,)
        if method == "reduce":
            done = _reduce(ufunc, inputs[0], **options)
        elif method != "__call__":
            raise Untraceable(f"{ufunc.__name__}.{method} has no rule")
        elif ufunc in SPECIAL:
            done = SPECIAL[ufunc](*inputs)
        else:
            done = _each(ufunc.__name__, ufunc, inputs)
        if out is None:
            return done
        out[...] = done
        return out

    def __array_function__(
        self, function: Any, types: Any, args: Any, kwargs: Any
    ) -> Any:
        if function in SPECIAL:
            return SPECIAL[function](*args, **kwargs)
        done = super().__array_function__(function, types, args, kwargs)
        if isinstance(done, np.ndarray) and done.dtype == object:
            return done.view(Symbols)
        return done

    def astype(self, dtype: Any, *_: Any, **__: Any) -> Any:
        """Return the symbols converted to another dtype."""
        kind = np.dtype(dtype)
        return _each(kind.name, kind.type, (self,))


def _reduce(
    ufunc: np.ufunc,
    array: Any,
    axis: Any = 0,
    dtype: Any = None,
    keepdims: bool = False,
    **_: Any,
) -> Symbols:
    """Apply a reduction as a sequence of binary operations."""
    symbols: Array = np.asarray(array).astype(object)
    chosen = range(symbols.ndim) if axis is None else np.atleast_1d(axis)
    axes = sorted(int(a) % symbols.ndim for a in chosen)
    kept = [a for a in range(symbols.ndim) if a not in axes]
    shape = [symbols.shape[a] for a in kept]
    rows = symbols.transpose(*kept, *axes).reshape(*shape, -1)
    out = np.empty(shape, object)
    for index in np.ndindex(*shape):
        items = list(rows[index]) or [ufunc.identity]
        if ufunc is np.add:
            items = [_counted(item) for item in items]
        out[index] = reduce(lambda a, b: _apply(ufunc.__name__, ufunc, a, b), items)
    if keepdims:
        out = np.expand_dims(out, tuple(axes))
    return out.view(Symbols)


def _counted(item: Scalar) -> Scalar:
    """Convert a bool to 0 or 1, as numpy does in sums."""
    value = item.value if isinstance(item, Symbol) else item
    if isinstance(value, (bool, np.bool_)):
        return _apply("int64", np.int64, item)
    return item
