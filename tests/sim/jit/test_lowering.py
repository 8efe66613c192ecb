"""Lowered operations: the same numbers as numpy's, of each kind, and of thousands."""

import numpy as np
import pytest

from marl_airhockey.sim.jit.fused import Fused

ONE = {
    "numbers": (np.negative, np.abs, np.sign, np.floor, np.ceil, np.square),
    "halves": (np.sin, np.cos, np.tan, np.arctan, np.exp, np.tanh, np.rint),
    "positive": (np.sqrt, np.log, np.log1p, np.isfinite, np.isnan, np.isinf),
}
"""Functions of one argument, by the source of it"""
TWO = (
    *(np.add, np.subtract, np.multiply, np.divide, np.maximum, np.minimum),
    *(np.fmin, np.fmax, np.arctan2, np.hypot, np.copysign, np.less, np.equal),
    *(np.greater_equal, np.not_equal, np.power, np.remainder, np.floor_divide),
)


def sources(worlds=6):
    rng = np.random.default_rng(0)
    made = {
        "numbers": rng.normal(size=(worlds, 3)),
        "halves": rng.integers(-3, 4, (worlds, 3)) / 2,
        "positive": rng.random((worlds, 3)) + 0.1,
        "whole": rng.integers(1, 9, (worlds, 3)),
        "truth": rng.random((worlds, 3)) < 0.5,
        "other": rng.random((worlds, 3)) < 0.5,
        "small": rng.normal(size=(worlds, 3)).astype(np.float32),
    }
    made["numbers"][0] = np.nan, np.inf, -0.0
    return made


def same(function):
    """Check that a compiled function gives what numpy does; return it."""
    fused, given = Fused(function, "a test"), sources()
    with np.errstate(all="ignore"):
        (real,) = function(given)
        (mine,) = fused(given)
    assert fused.refused is None
    for key, array in real.items():
        assert mine[key].dtype == array.dtype, key
        np.testing.assert_allclose(mine[key], array, rtol=1e-14, err_msg=key)
    return fused


@pytest.mark.parametrize("name", ONE)
def test_functions_of_one_number(name):
    same(lambda s: ({f.__name__: f(s[name]) for f in ONE[name]},))


@pytest.mark.parametrize("second", ["halves", "positive", "whole", "small"])
def test_functions_of_two_numbers(second):
    same(lambda s: ({f.__name__: f(s["positive"], s[second]) for f in TWO},))


def test_whole_numbers_and_truths():
    def function(s):
        a, b, n = s["truth"], s["other"], s["whole"]
        return (
            {
                "and": a & b,
                "or": a | b,
                "not": ~a,
                "sum": a + b,
                "product": a * b,
                "count": n + a,
                "bits": ~n,
                "difference": n - 9,
                "share": n / 7,
                "many": (n > 3).sum(-1),
                "as_float": a.astype(np.float64),
                "as_small": n.astype(np.float32),
                "cut": (s["positive"] * 10).astype(np.int64),
            },
        )

    same(function)


def test_choices_between_kinds_and_with_nan():
    def function(s):
        x, a = s["numbers"], s["truth"]
        return (
            {
                "number": np.where(a, 1, 0.5),
                "flag": np.where(a, False, s["other"]),
                "mixed": np.where(a, s["whole"], x),
                "at_most": np.minimum(x, 0.25),
                "at_least": np.maximum(0.25, x),
                "within": np.clip(x, -0.5, 0.5),
                "chosen": np.where(x > 0, x, np.nan),
            },
        )

    same(function)


def test_thousands_of_operations():
    """Numba needs minutes and gigabytes for as many lines in one function."""

    def function(s):
        x, y = s["positive"], s["halves"]
        for k in range(300):
            x, y = np.where(x > y, x - 0.25 * y, x), np.minimum(y + x / (k + 1), 2.0)
        return ({"x": x, "y": y},)

    assert same(function)._loop._source.count("\n") > 3_000


def test_what_has_no_rule_is_named():
    def function(s):
        return ({"y": np.heaviside(s["numbers"], s["positive"])},)

    with pytest.warns(RuntimeWarning, match="no heaviside of float64, float64"):
        Fused(function, "a test")(sources())
