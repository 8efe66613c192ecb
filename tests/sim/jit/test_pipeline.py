"""Compiled stages, called one after another."""

import numpy as np

import marl_airhockey as ah
from marl_airhockey.sim.jit.codegen import load
from marl_airhockey.sim.jit.pipeline import Fixed, Pipeline, Stage


def test_a_pipeline_calls_its_stages_until_one_stops_it():
    source = (
        "import numpy as np\n"
        "SIGNATURE = 'boolean(float64[:, ::1], float64[::1], float64)'\n"
        "def kernel(x, limit, add):\n"
        "    x += add\n"
        "    return x.max() < limit[0]\n"
    )
    add = load(source, "a test").kernel
    x, limit = np.zeros((4, 2)), np.full(1, 2.5)
    first = Stage(add, (x, Fixed(limit), 1.0), stops=True)
    pipeline = Pipeline(4, [first, Stage(add, (x, Fixed(limit), 0.25))], "a test")
    assert pipeline()
    np.testing.assert_array_equal(x, 1.25)
    assert pipeline()
    assert not pipeline()
    np.testing.assert_array_equal(x, 3.5)


def test_scenes_of_all_sizes_share_one_compiled_kernel_of_the_physics(monkeypatch):
    sources = set()

    def note(source, *rest):
        if "numba.kernel.advance" in source:
            sources.add(source)
        return load(source, *rest)

    monkeypatch.setattr("marl_airhockey.sim.jit.pipeline.load", note)
    for options in ({}, {"pucks": 3}):
        ah.make_world("duel", 2, options=options).reset(0)
    ah.make_world("free_for_all", 2, options={"sides": 5}).reset(0)
    assert len(sources) == 1
