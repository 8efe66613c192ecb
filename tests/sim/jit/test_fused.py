"""Numpy functions compiled over worlds: the same numbers, and honest about failing."""

from dataclasses import dataclass

import numpy as np
import pytest
from pair import Pair

import marl_airhockey as ah
from marl_airhockey.sim.jit.fused import Fused


def many_operations(source, other):
    x, n, flag = source["x"], source["n"], source["flag"]
    y = np.where(flag[..., None], x, np.sqrt(np.abs(x)))
    y[..., 0] = np.clip(x[..., 1], -0.5, 0.5)
    rotated = (other["rotation"] @ x[..., None, :, None])[..., 0]
    seen = (x > 0) & ~flag[..., None]
    seen |= n[..., None] > 3
    return (
        {
            "y": np.exp(-y) / (1.0 + x * x),
            "rotated": rotated,
            "count": seen.sum(-1) + n,
            "any": seen.any(-1),
            "least": np.fmin.reduce(x, axis=-1),
            "span": x.max(-1) - x.min(-1),
        },
        {"stacked": np.stack([x, np.zeros_like(x)], -2), "same": other["kept"]},
        {"constant": np.full((*n.shape, 2), 0.25), "small": x.astype(np.float32)},
    )


def sources(worlds, seed=0):
    rng = np.random.default_rng(seed)
    first = {
        "x": rng.normal(size=(worlds, 3)),
        "n": rng.integers(0, 9, worlds),
        "flag": rng.random(worlds) < 0.5,
        "what": "no array",
    }
    first["x"][0, 1] = np.inf
    kept = rng.normal(size=(worlds, 2))
    return first, {"kept": kept, "rotation": rng.normal(size=(worlds, 4, 3, 3))}


@pytest.mark.parametrize("worlds", [1, 7])
def test_a_compiled_function_gives_what_numpy_gives(worlds):
    fused = Fused(many_operations, "a test")
    for seed in range(3):
        given = sources(worlds, seed)
        for mine, real in zip(fused(*given), many_operations(*given), strict=True):
            assert mine.keys() == real.keys()
            for key, array in real.items():
                assert mine[key].dtype == array.dtype
                np.testing.assert_allclose(mine[key], array, rtol=1e-12, err_msg=key)
    assert fused.refused is None


def test_outputs_are_fresh_at_every_call():
    fused, given = Fused(many_operations, "a test"), sources(1)
    calls = [fused(*given)[0]["y"] for _ in range(70)]
    for i, array in enumerate(calls):
        array[:] = i
    assert [array[0, 0] for array in calls] == list(range(70))


def test_arrays_that_are_not_row_behind_row_are_copied():
    fused, given = Fused(many_operations, "a test"), sources(5)
    fused(*given)
    first = given[0] | {"x": np.asfortranarray(given[0]["x"])}
    np.testing.assert_allclose(
        fused(first, given[1])[0]["y"], many_operations(*given)[0]["y"]
    )


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (lambda s: ({"y": s["x"] if s["x"].sum() > 0 else -s["x"]},), "branches"),
        (lambda s: ({"y": np.sort(s["x"], axis=-1)},), "branches"),
        (lambda s: ({"y": s["x"] * len(s["x"])},), "differs"),
    ],
)
def test_what_cannot_be_compiled_runs_as_it_is_and_says_so(function, reason):
    fused, given = Fused(function, "a test"), {"x": np.array([[3.0, -1.0]] * 5)}
    with pytest.warns(RuntimeWarning, match=reason):
        (mine,) = fused(given)
    np.testing.assert_array_equal(mine["y"], function(given)[0]["y"])
    (again,) = fused(given)
    np.testing.assert_array_equal(again["y"], mine["y"])


def test_a_number_that_changes_its_type_is_not_cut_off():
    fused = Fused(lambda s: ({"x": s["x"] + 0.5},), "a test")
    whole = {"x": np.zeros(2, np.int64)}
    assert fused(whole)[0]["x"].tolist() == [0.5, 0.5]
    assert fused({"x": np.ones(2, np.int32)})[0]["x"].tolist() == [1.5, 1.5]
    with pytest.warns(RuntimeWarning, match="safe"):
        done = fused({"x": np.array([0.25, 0.75])})
    assert done[0]["x"].tolist() == [0.75, 1.25]


@dataclass(frozen=True, kw_only=True)
class Sorted(Pair):
    """Its success needs a sort, which is not traced."""

    def success(self, t):
        return np.sort(t.new_memory["goals"], axis=-1) >= 3


def test_a_scenario_that_cannot_be_compiled_still_plays():
    plain, compiled = (ah.make_world(kind(), 3) for kind in (Sorted, Pair))
    with pytest.warns(RuntimeWarning, match="plain numpy"):
        plain.reset(0)
    compiled.reset(0)
    action = np.full((3, 2, 2), 0.7)
    for _ in range(50):
        np.testing.assert_allclose(
            plain.step(action).reward, compiled.step(action).reward, atol=1e-12
        )
    assert compiled.referee.refused is None
    assert "branches" in plain.referee.refused
