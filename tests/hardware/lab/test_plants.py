"""The lab's table on every simulation."""

import numpy as np
import pytest

from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.world import LabWorld


@pytest.mark.parametrize("plant", ["numba", "pymunk", "robosuite"])
def test_a_held_puck_rests_and_a_released_one_meets_the_paddle(plant):
    if plant == "robosuite":
        pytest.importorskip("robosuite")
    setup = LabSetup(plant=plant)
    world, home = LabWorld(setup), np.array(setup.home)
    ahead = home + np.array([0.4, 0.0])
    world.put(ahead, np.array([-1.0, 0.0]), held=True)
    for _ in range(12):
        world.step(home, np.zeros(2), 0.0)
    np.testing.assert_allclose(world.puck, ahead, atol=1e-6)
    world.release()
    for _ in range(90):
        world.step(home, np.zeros(2), 0.0)
    assert world.touches
    assert world.puck[0] > home[0]
