"""Sine and cosine of a number, and series, for `elementary`.

An angle is reduced to a rest between -pi / 4 and pi / 4. The parts of pi / 2 have so
few bits that their products with a number of quarters of a turn are exact (Cody and
Waite, see `elementary`). An angle above `FAR` is multiplied by as many bits of 2 / pi
as it needs (M. Payne and R. Hanek, "Radian reduction for trigonometric functions",
1983).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from marl_airhockey.sim.jit.cache import inner

FAR = 1e6
"""Angle, rad, above which the reduction needs more bits of 2 / pi."""
ROUND = 6755399441055744.0
"""1.5 * 2^52: a smaller number becomes an integer if this is added and subtracted."""
_HALF_PI_1 = float.fromhex("0x1.921fb544p+0")
"""First 33 bits of pi / 2. Two more parts with 33 bits, and the rest, follow."""
_HALF_PI_2 = float.fromhex("0x1.0b4611a6p-34")
_HALF_PI_3 = float.fromhex("0x1.3198a2e0p-69")
_HALF_PI_4 = float.fromhex("0x1.b839a252049c1p-104")
_TWO_OVER_PI = int(
    "a2f9836e4e441529fc2757d1f534ddc0db6295993c439041fe5163abdebbc561b7246e3a424dd2e0"
    "06492eea09d1921cfe1deb1cb129a73ee88235f52ebb4484e99c7026b45f7e413991d639835339f4"
    "9c845f8bbdf9283b1ff897ffde05980fef2f118b5a0a6d1f6d367ecf27cb09b74f463f669e5fea2d"
    "7527bac7ebe5f17b3d0739f78a5292ea6bfb5fb11f8d5d0856033046fc7b6babf0cfbc20",
    16,
)
"""First 1248 bits of 2 / pi."""
_PIECES = np.array(
    [0, 0, *(_TWO_OVER_PI >> 32 * k & 0xFFFFFFFF for k in range(38, -1, -1))], np.uint64
)
"""The same in numbers of 32 bits, the highest first, after 64 bits that are 0."""
_QUARTER, _QUARTER_REST = math.pi / 2, float.fromhex("0x1.1a62633145c07p-54")
"""pi / 2 in two parts."""
_32, _LOW = np.uint64(32), np.uint64(0xFFFFFFFF)


def taylor(first: int, step: int, count: int, signs: int) -> tuple[float, ...]:
    """Return 1 / n! for n = first, first + step, ..., the last first."""
    powers = [first + step * k for k in range(count)]
    values = [signs**k / math.factorial(n) for k, n in enumerate(powers)]
    return tuple(reversed(values))


_SIN = tuple(-c for c in taylor(3, 2, 8, -1))
"""Coefficients of (sin(r) - r) / r^3 in powers of r^2."""
_COS = taylor(4, 2, 7, -1)
"""Coefficients of (cos(r) - 1 + r^2 / 2) / r^4 in powers of r^2."""


@inner(error_model="numpy", forceinline=True)
def series(x: float, coefficients: tuple[float, ...]) -> float:
    """Return a polynomial, given its coefficients, the highest power first."""
    total = coefficients[0]
    for c in coefficients[1:]:
        total = total * x + c
    return total


@inner(error_model="numpy", forceinline=True)
def _long_product(a: Any, b: Any) -> tuple[Any, Any]:
    """Return the upper and the lower 64 bits of a product."""
    a1, a0, b1, b0 = a >> _32, a & _LOW, b >> _32, b & _LOW
    middle = a1 * b0 + (a0 * b0 >> _32)
    other = a0 * b1 + (middle & _LOW)
    return a1 * b1 + (middle >> _32) + (other >> _32), a * b


@inner(error_model="numpy", forceinline=True)
def _window(first: Any) -> Any:
    """Return 64 bits of 2 / pi after a number of bits."""
    word, shift = first >> 5, np.uint64(first & 31)
    pair = _PIECES[word] << _32 | _PIECES[word + 1]
    return pair << shift | _PIECES[word + 2] >> (_32 - shift)


@inner(error_model="numpy", forceinline=True)
def split(x: float) -> tuple[float, float]:
    """Return two numbers of at most 26 bits whose sum is x."""
    high = x * 134217729.0
    high -= high - x
    return high, x - high


@inner(error_model="numpy")
def _far(x: float) -> tuple[Any, float, float]:
    """Return the result of `reduced` for any finite angle from `FAR` on."""
    bits = np.float64(x).view(np.int64)
    # Higher bits of 2 / pi only add multiples of 4 to the number of quarters of a turn.
    first = (bits >> 52) - 1075 + 64 - 2
    mantissa = np.uint64((bits & ((1 << 52) - 1)) | (1 << 52))
    _, top = _long_product(mantissa, _window(first))
    high, middle = _long_product(mantissa, _window(first + 64))
    more, low = _long_product(mantissa, _window(first + 128))
    middle += more
    top += high + np.uint64(middle < more)
    # The first two bits are quarters of a turn, the others a fraction of one.
    quarters = np.int64(top >> np.uint64(62))
    one = top << np.uint64(2) | middle >> np.uint64(62)
    two = middle << np.uint64(2) | low >> np.uint64(62)
    sign = 1.0
    if one >> np.uint64(63):
        quarters, sign, one, two = quarters + 1, -1.0, ~one, ~two
    a, b = float(one >> _32) * 2.0**-32, float(one & _LOW) * 2.0**-64
    share = a + b
    rest = (b - (share - a)) + float(two) * 2.0**-128
    # The product with pi / 2, in two parts.
    whole = share + rest
    rest -= whole - share
    (a, b), product = split(whole), whole * _QUARTER
    c, d = split(_QUARTER)
    rest = ((a * c - product) + a * d + b * c) + b * d + rest * _QUARTER
    rest += whole * _QUARTER_REST
    return quarters, sign * product, sign * rest


@inner(error_model="numpy", forceinline=True)
def reduced(x: float) -> tuple[int, float, float]:
    """Return n, r and t with |x| = n pi / 2 + r + t, where t is the smaller part."""
    x = abs(x)
    if x > FAR:
        return _far(x)
    n = (x * (2.0 / math.pi) + ROUND) - ROUND
    start, step = x - n * _HALF_PI_1, n * _HALF_PI_2
    first = start - step
    back = first - start
    error = (start - (first - back)) - (step + back)
    rest = error - n * _HALF_PI_3 - n * _HALF_PI_4
    r = first + rest
    return int(n), r, rest - (r - first)


@inner(error_model="numpy", forceinline=True)
def _short_sin(r: float, rest: float) -> float:
    """Return the sine of r + rest, |r| <= pi / 4."""
    z = r * r
    return r + (r * z * series(z, _SIN) + rest * (1.0 - 0.5 * z))


@inner(error_model="numpy", forceinline=True)
def _short_cos(r: float, rest: float) -> float:
    """Return the cosine of r + rest, |r| <= pi / 4."""
    z = r * r
    half = 0.5 * z
    start = 1.0 - half
    return start + (((1.0 - start) - half) + (z * z * series(z, _COS) - r * rest))


@inner(error_model="numpy")
def sine(x: float) -> float:
    """Return the sine of an angle, rad."""
    if not abs(x) < np.inf:
        return np.nan
    if x == 0.0:
        return x
    n, r, rest = reduced(x)
    value = _short_cos(r, rest) if n & 1 else _short_sin(r, rest)
    return -value if (x < 0.0) != (n & 2 > 0) else value


@inner(error_model="numpy")
def cosine(x: float) -> float:
    """Return the cosine of an angle, rad."""
    if not abs(x) < np.inf:
        return np.nan
    n, r, rest = reduced(x)
    value = _short_sin(r, rest) if n & 1 else _short_cos(r, rest)
    return -value if (n + 1) & 2 else value
