"""Position-driven drivers that command their device themselves."""

import numpy as np

import marl_airhockey as ah
from marl_airhockey.sim.contracts.driver import Driver

ACTION = np.array([[0.3, -0.4]])


class Arm(Driver):
    """Device at rest, whatever it is told."""

    commands_device = True

    def act(self, view, memory):
        self.seen = dict(zip(view.labels, view.observation[0], strict=True))
        return ACTION, memory

    def measured(self):
        return np.array([[-0.6, 0.1, 0.0, 0.0]])


def test_what_it_requested_is_seen_and_moves_nothing_else():
    arm = Arm()
    world = ah.make_world("juggle", 1, drivers={"paddle_0": arm}, profile="ur5e")
    world.reset(0)
    world.step(np.zeros((1, 0, 2)))
    np.testing.assert_allclose(world.requested[0, 0], ACTION[0])
    np.testing.assert_allclose(world.state.paddle[0, 0], [-0.6, 0.1], atol=1e-6)
    world.step(np.zeros((1, 0, 2)))
    last = [arm.seen[f"own.requested[-1].{axis}"] for axis in "xy"]
    np.testing.assert_allclose(last, ACTION[0], atol=1e-6)
