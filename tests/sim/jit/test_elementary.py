"""Elementary functions: precision, special values, and one result everywhere."""

import mpmath
import numba
import numpy as np
import pytest

from marl_airhockey.sim.core.laws import fly
from marl_airhockey.sim.jit import elementary
from marl_airhockey.sim.jit.fused import Fused

HUGE = 709.0
"""Logarithm of the largest number"""


def arguments(rng, n):
    """Arguments by function: usual ones, tiny ones, and all magnitudes."""
    tiny = rng.normal(0.0, 1e-6, n)
    every = np.exp(rng.uniform(-740.0, HUGE, n))
    angles = [rng.uniform(-7.0, 7.0, n), rng.uniform(-1e6, 1e6, n), every]
    quarters = np.pi / 2 * np.arange(1, n + 1)
    yield from [("sin", x) for x in (*angles, quarters, tiny)]
    yield from [("cos", x) for x in (*angles, quarters, tiny)]
    for name in ("exp", "expm1"):
        ranges = rng.uniform(-1.0, 1.0, n), rng.uniform(-745.0, HUGE, n), tiny
        yield from [(name, x) for x in ranges]
    yield from [("log", x) for x in (rng.uniform(0.0, 3.0, n), every, 1.0 + tiny)]
    near = -1.0 + np.exp(rng.uniform(-36.0, 0.0, n))
    yield from [("log1p", x) for x in (rng.uniform(-1.0, 3.0, n), every, tiny, near)]


def off(found, exact):
    """Error in units in the last place of the exact value."""
    last = float(np.spacing(abs(float(exact)))) if exact else 5e-324
    return float(abs(mpmath.mpf(float(found)) - exact) / mpmath.mpf(last))


def check(n):
    for name, values in arguments(np.random.default_rng(0), n):
        bits = 1300 if name in ("sin", "cos") and values.max() > 1e9 else 120
        exactly = getattr(mpmath, name)
        found = getattr(elementary, name)(values)
        with mpmath.workprec(bits):
            for x, y in zip(values, found, strict=True):
                exact = exactly(mpmath.mpf(float(x)))
                assert off(y, exact) <= 1.0, f"{name}({float(x).hex()}) is {y!r}"


def check_lengths(n):
    rng = np.random.default_rng(1)
    assert elementary.hypot(-3.0, 0.0) == 3.0
    for scale in (1.0, 1e200, 1e-200, 1e-310):
        x = rng.normal(0.0, scale, n)
        y = rng.normal(0.0, scale, n) * 10.0 ** rng.uniform(-20.0, 0.0, n)
        with mpmath.workprec(120):
            for a, b, c in zip(x, y, elementary.hypot(x, y), strict=True):
                squares = mpmath.mpf(float(a)) ** 2 + mpmath.mpf(float(b)) ** 2
                assert off(c, mpmath.sqrt(squares)) <= 1.0, (a, b)


def test_they_are_one_unit_in_the_last_place_off_at_most():
    check(400)
    check_lengths(400)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_they_are_for_a_million_arguments_each():
    check(250_000)
    check_lengths(250_000)


def test_special_values_are_those_of_numpy():
    values = np.array(
        [
            *(0.0, -0.0, np.inf, -np.inf, np.nan, 1e308, -1e308, 5e-324, -5e-324),
            *(1.0, -1.0, 709.782712893384, 709.7828, -745.13, -745.14),
            *(2.0**-1022, 1e-320),
        ]
    )
    for name, own in elementary.ELEMENTARY.items():
        given = (values,) if name != "hypot" else np.meshgrid(values, values)
        with np.errstate(all="ignore"):
            usual = getattr(np, name)(*given)
        found = own(*given)
        signs = np.where(np.isnan(usual), 0.0, np.copysign(1.0, found))
        expected = np.where(np.isnan(usual), 0.0, np.copysign(1.0, usual))
        assert np.array_equal(signs, expected), name
        np.testing.assert_allclose(found, usual, 4e-16, 1e-323, err_msg=name)


def test_arrays_numbers_and_compiled_rules_have_the_same_bits():
    x = np.random.default_rng(2).uniform(0.01, 5.0, (7, 3))

    def rules(own, arrays):
        return ({k: f(arrays["x"]) for k, f in own.items() if k != "hypot"},)

    for own in (elementary.ELEMENTARY, {k: getattr(np, k) for k in ("exp", "sin")}):
        fused = Fused(lambda arrays, own=own: rules(own, arrays), "these rules")
        (found,) = fused({"x": x})
        assert fused.refused is None
        for name, array in found.items():
            wanted = getattr(elementary, name)(x)
            assert np.array_equal(array, wanted), name
            assert wanted[2, 1] == getattr(elementary, name)(float(x[2, 1]))


def test_products_are_not_fused_with_sums():
    def sum_of_product(a, b, c):
        return a * b + c

    for function in (sum_of_product, fly.py_func):
        code = numba.njit(error_model="numpy")(function)
        code(*(1.5 + k for k in range(function.__code__.co_argcount)))
        (text,) = code.inspect_asm().values()
        assert "mulsd" in text
        assert "fma" not in text.replace(".cfi", "")
