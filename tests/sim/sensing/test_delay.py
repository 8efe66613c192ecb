"""Delay line: linear between the values of control steps, each world by its own."""

import numpy as np

from marl_airhockey.sim.sensing.delay import Delay

DT = 0.05


def test_values_are_interpolated_at_the_delay_of_each_world():
    delays = np.array([0.0, 0.02, 0.05, 0.07, 0.12])
    rng = np.random.default_rng(0)
    values = rng.normal(size=(12, len(delays), 2))
    line = Delay(0.12, DT, values[0].shape)
    line.fill(slice(None), values[0][:, None])
    times = DT * np.arange(len(values))
    for step in range(1, len(values)):
        found = line.push(values[step], delays)
        for world, delay in enumerate(delays):
            for axis in range(2):
                path = values[:, world, axis]
                expected = np.interp(times[step] - delay, times, path)
                np.testing.assert_allclose(found[world, axis], expected, atol=1e-12)
