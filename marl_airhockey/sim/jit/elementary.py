"""Elementary functions with the same bits on every machine.

The C libraries of systems, and NumPy on different processors, differ in the last bit of
sines and logarithms. Contacts amplify such a difference, so games would differ after
seconds. These functions consist of basic operations, whose results IEEE 754 defines to
the bit. They are compiled from one source, and at most one unit in the last place off.

A function takes numbers or arrays, which it converts to float64, and symbols of the
tracer. Compiled code calls it with one number. In compiled rules it also replaces the
function of NumPy with its name.

Method: The argument is reduced to a small interval, in which the Taylor series has a
remainder far below the last bit. Its coefficients are therefore those of the series.
Sums keep their rounding error where it would count. Constants have parts with so few
bits that products with a number of periods are exact (W. J. Cody and W. Waite,
"Software Manual for the Elementary Functions", 1980).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload

from marl_airhockey.sim.jit.angles import ROUND, cosine, series, sine, split, taylor
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array

_LN2_1 = float.fromhex("0x1.62e42feep-1")
"""First 32 bits of ln 2."""
_LN2_2 = float.fromhex("0x1.a39ef35793c76p-33")
"""ln 2 less its first part."""
_SQRT_HALF = int(np.float64(math.sqrt(0.5)).view(np.int64))
"""Bits of the square root of 1 / 2."""


_EXP_EVEN, _EXP_ODD = taylor(2, 2, 7, 1), taylor(3, 2, 7, 1)
"""Coefficients of (exp(r) - 1 - r) / r^2 in powers of r^2, without r and with r."""
_LOG = tuple(2.0 / (2 * k + 1) for k in range(10, 0, -1))
"""Coefficients of (ln((1 + s) / (1 - s)) - 2 s) / s^3 in powers of s^2."""


@inner(error_model="numpy", forceinline=True)
def _scaled(x: float, k: int) -> float:
    """Return x * 2^k with one rounding, |k| < 2000."""
    half = k >> 1
    first = np.int64((half + 1023) << 52).view(np.float64)
    return float(x * first * np.int64((k - half + 1023) << 52).view(np.float64))


@inner(error_model="numpy", forceinline=True)
def _exp_reduced(x: float) -> tuple[int, float, float]:
    """Return k, r and t with exp(x) = 2^k (1 + r + t), where t is the smaller part."""
    k = (x * (1.0 / math.log(2.0)) + ROUND) - ROUND
    high, low = x - k * _LN2_1, k * _LN2_2
    r = high - low
    z = r * r
    return int(k), high, z * (series(z, _EXP_EVEN) + r * series(z, _EXP_ODD)) - low


@inner(error_model="numpy")
def _exp(x: float) -> float:
    if x > 709.79 or x != x:
        return x * np.inf
    if x < -745.2:
        return 0.0
    k, r, rest = _exp_reduced(x)
    return _scaled(1.0 + (r + rest), k)


@inner(error_model="numpy")
def _expm1(x: float) -> float:
    if x > 709.79 or x != x:
        return x * np.inf
    if x < -37.5:
        return -1.0
    if abs(x) < 0.5:
        if x == 0.0:
            return x
        # x + x^2 / 2 without an error, then the rest of the series.
        z, (high, low) = x * x, split(x)
        half = 0.5 * high * high
        total = x + half
        error = (half - (total - x)) + 0.5 * low * (x + high)
        rest = z * series(z, _EXP_EVEN[:-1]) + x * series(z, _EXP_ODD)
        return total + (error + z * rest)
    k, r, rest = _exp_reduced(x)
    one = _scaled(1.0, -k)
    start = 1.0 - one
    total = start + r
    back = total - start
    error = (start - (total - back)) + (r - back) + ((1.0 - start) - one)
    return _scaled(total + (error + rest), k)


@inner(error_model="numpy", forceinline=True)
def _log_parts(x: float) -> tuple[float, float]:
    """Return k and f with x = 2^k (1 + f), x > 0 and sqrt(1/2) <= 1 + f < sqrt(2)."""
    lift = 54 if x < 2.0**-1022 else 0
    bits = np.float64(x * 2.0**54 if lift else x).view(np.int64)
    moved = bits + ((1023 << 52) - _SQRT_HALF)
    mantissa = (moved & ((1 << 52) - 1)) + _SQRT_HALF
    return float((moved >> 52) - 1023 - lift), np.int64(mantissa).view(np.float64) - 1.0


@inner(error_model="numpy", forceinline=True)
def _log_sum(k: float, f: float, error: float) -> float:
    """Return ln(2^k (1 + f)) + error."""
    s, half = f / (2.0 + f), 0.5 * f * f
    z = s * s
    rest = s * (half + z * series(z, _LOG)) + (k * _LN2_2 + error)
    return k * _LN2_1 - ((half - rest) - f)


@inner(error_model="numpy")
def _log(x: float) -> float:
    if not x > 0.0:
        return -np.inf if x == 0.0 else np.nan
    if x == np.inf:
        return x
    k, f = _log_parts(x)
    return _log_sum(k, f, 0.0)


@inner(error_model="numpy")
def _log1p(x: float) -> float:
    if not x > -1.0:
        return -np.inf if x == -1.0 else np.nan
    if x == 0.0 or x == np.inf:
        return x
    if -0.29 < x < 0.41:
        return _log_sum(0.0, x, 0.0)
    total = 1.0 + x
    error = x - (total - 1.0) if x < 1.0 else 1.0 - (total - x)
    k, f = _log_parts(total)
    return _log_sum(k, f, error / total)


@inner(error_model="numpy")
def _hypot(x: float, y: float) -> float:
    x, y = abs(x), abs(y)
    if x == np.inf or y == np.inf:
        return np.inf
    most, least = max(x, y), min(x, y)
    if most == 0.0 or x != x or y != y:
        return x + y
    scale = 1.0
    if most > 1e150:
        scale = 2.0**600
    elif most < 1e-130:
        scale = 2.0**-600
    a, b = most / scale, least / scale
    length = np.sqrt(a * a + b * b)
    error = (a - length) * (a + length) + b * b
    return float(length + error / (2.0 * length)) * scale


@compiled(nogil=True, error_model="numpy")
def _fill(kind: int, x: Array, y: Array, out: Array) -> None:
    """Fill an array (n,) with a function of other arrays (n,), by its number."""
    for i in range(len(out)):
        if kind == 0:
            out[i] = _exp(x[i])
        elif kind == 1:
            out[i] = _expm1(x[i])
        elif kind == 2:
            out[i] = _log(x[i])
        elif kind == 3:
            out[i] = _log1p(x[i])
        elif kind == 4:
            out[i] = sine(x[i])
        elif kind == 5:
            out[i] = cosine(x[i])
        else:
            out[i] = _hypot(x[i], y[i])


def _values(kind: int, name: str, x: Any, y: Any = None) -> Any:
    """Return a function of numbers, arrays or symbols, by its number and name."""
    if y is not None:
        x, y = np.broadcast_arrays(x, y)
    if np.asarray(x).dtype == object:
        return getattr(np, name)(*((x,) if y is None else (x, y)))
    first = np.ascontiguousarray(x, np.float64)
    second = first if y is None else np.ascontiguousarray(y, np.float64)
    out = np.empty(np.shape(x))
    _fill(kind, first.reshape(-1), second.reshape(-1), out.reshape(-1))
    return out[()]


def exp(x: Any) -> Any:
    """Return e to the power of x."""
    return _values(0, "exp", x)


def expm1(x: Any) -> Any:
    """Return e to the power of x, less 1, which is exact for small x, too."""
    return _values(1, "expm1", x)


def log(x: Any) -> Any:
    """Return the natural logarithm of x; nan below 0."""
    return _values(2, "log", x)


def log1p(x: Any) -> Any:
    """Return the natural logarithm of 1 + x, which is exact for small x, too."""
    return _values(3, "log1p", x)


def sin(x: Any) -> Any:
    """Return the sine of an angle, rad."""
    return _values(4, "sin", x)


def cos(x: Any) -> Any:
    """Return the cosine of an angle, rad."""
    return _values(5, "cos", x)


def hypot(x: Any, y: Any) -> Any:
    """Return the length of a vector (x, y), without overflow."""
    return _values(6, "hypot", x, y)


ELEMENTARY: dict[str, Callable[..., Any]] = {
    f.__name__: f for f in (exp, expm1, log, log1p, sin, cos, hypot)
}
"""Functions that replace NumPy's functions of the same names in compiled rules."""


def _compile_as(function: Callable[..., Any], scalar: Callable[..., Any]) -> None:
    """Make compiled code call a function of one number where it calls a function."""
    options: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}
    overload(function, jit_options=options, strict=False)(lambda *_: scalar)


_SCALARS: tuple[Callable[..., Any], ...] = (
    _exp,
    _expm1,
    _log,
    _log1p,
    sine,
    cosine,
    _hypot,
)
for _function, _scalar in zip(ELEMENTARY.values(), _SCALARS, strict=True):
    _compile_as(_function, _scalar)
