"""First states: what falls can be reached, on the tables that a robot plays on."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.sim.core.table import TABLES


@pytest.mark.parametrize("profile", ["ideal", "ur5e"])
@pytest.mark.parametrize("table", TABLES)
def test_nearly_all_falling_pucks_can_be_intercepted(table, profile):
    """A puck passes the reach where a paddle can be, a servo's lag after the start."""
    worlds = 1000
    world = ah.make_world(
        "touch", worlds, options={"table": table}, profile=profile, max_cycles=999
    )
    world.autoreset = False
    world.reset(0)
    paddle = world.state.paddle[:, 0].copy()
    touch = TABLES[table].paddle_radius + TABLES[table].puck_radius
    normals, offsets = world.reach.normals[0], world.reach.offsets[0]
    met = np.zeros(worlds, bool)
    for _ in range(140):
        world.step(np.zeros((worlds, 1, 2)))
        puck, time = world.state.puck[:, 0], world.state.time
        inside = (puck @ normals.T + offsets >= 0.0).all(-1)
        way = np.linalg.norm(puck - paddle, axis=-1) - touch
        # From rest at 7 m/s2 and 0.7 m/s, 0.17 s of delays before it.
        met |= inside & (way <= 0.7 * (time - 0.17 - 0.05))
        met |= world.memory["touches"][:, 0, 0] > 0
    assert met.mean() >= 0.95


def test_shots_are_feasible_under_the_physics_of_the_episode():
    for profile, most in (("ideal", 0.001), ("ur5e", 0.01)):
        world = ah.make_world("hit_goal_velocity", 4096, profile=profile)
        world.reset(0)
        place, velocity = world.memory["goal"], world.memory["goal_velocity"]
        none = (place == (0.39, 0.0)).all(-1) & (velocity == (0.7, 0.0)).all(-1)
        assert none.mean() <= most
        assert (velocity[:, 0] >= 0.5)[~none].all()
        assert (np.abs(place[:, 1]) < 0.205).all()
