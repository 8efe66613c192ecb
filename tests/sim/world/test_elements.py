"""Elements that options add to any scenario: obstacles, regions of reward and drag."""

import copy

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.sim.core.limits import away
from marl_airhockey.sim.core.seat import OBSTACLE_MARGIN, ReachPlanes

POSTS = [[0.2, 0.0, 0.05], [-0.45, 0.05, 0.02, -0.45, 0.2]]


def rooms(world, points, radius):
    """Gaps (O, ...) of discs of a radius to the obstacles, m."""
    planes = ReachPlanes.of(world.scene.table, world.scene.seats).obstacles
    near = world.scene.table.paddle_radius + OBSTACLE_MARGIN
    flat = points.reshape(-1, 2)
    gaps = [[away(o, x, y)[2] + near - radius for x, y in flat] for o in planes]
    return np.array(gaps)


def test_nothing_enters_an_obstacle(backend):
    # pymunk finds a contact at the end of a substep.
    worlds, deepest = (32, 2.5e-4) if backend == "numba" else (4, 1e-3)
    options = {"obstacles": POSTS}
    world = ah.make_world("hit_goal", worlds, backend=backend, options=options)
    rng, table = np.random.default_rng(0), world.scene.table
    world.reset(0)
    goal = world.memory["goal"]
    assert (rooms(world, goal, table.paddle_radius) >= 0).all()
    action = np.zeros((worlds, 1, 2))
    for k in range(300):
        if k % 7 == 0:
            action = rng.uniform(-2.0, 2.0, action.shape)
        world.step(action)
        state = world.judged
        assert rooms(world, state.paddle, table.paddle_radius).min() > 0.0
        assert rooms(world, state.puck, table.puck_radius).min() > -deepest


def test_a_paddle_stops_in_front_of_an_obstacle():
    world = ah.make_world("reach", 1, options={"obstacles": POSTS})
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    state.paddle[:] = (-0.65, 0.12)
    world.set_state(state, memory)
    for _ in range(30):
        violation = world.step(np.array([[[1.0, 0.0]]])).violation
    edge = -0.45 - 0.02 - world.scene.table.paddle_radius
    assert world.state.paddle[0, 0, 0] == pytest.approx(edge, abs=2e-3)
    assert violation[0, 0, 3] > 0.3


def test_a_region_pays_while_the_paddle_is_inside():
    options = {"reward_regions": [[-0.65, 0.0, 0.1, -2.0], [-0.65, 0.0, 0.05, -1.0]]}
    world = ah.make_world("reach", 1, options=options)
    world.autoreset = False
    world.reset(0)
    for place, pays in (((-0.65, 0.0), -3.0), ((-0.65, 0.07), -2.0), ((-0.5, 0), 0.0)):
        state, memory = world.get_state()
        state.paddle[:], state.paddle_velocity[:] = place, 0.0
        world.set_state(state, memory)
        step = world.step(np.zeros((1, 1, 2)))
        assert step.terms["regions"][0, 0] == pytest.approx(0.05 * pays)


def test_a_region_slows_the_puck(backend):
    options = {"drag_regions": [[0.3, 0.0, 0.2, 3.0]]}
    physics = {"puck_drag": 0.0, "puck_damping": 0.1, "tilt": 0.0}
    world = ah.make_world("touch", 2, backend=backend, options=options, physics=physics)
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    state.puck[:, 0], state.puck_velocity[:, 0] = [(0.25, 0), (-0.1, 0)], (0.2, 0.0)
    state.spin[:] = 0.0
    world.set_state(state, memory)
    for _ in range(2):
        world.step(np.zeros((2, 1, 2)))
    other = copy.deepcopy(world)
    for each in (world, other):
        for _ in range(2):
            each.step(np.zeros((2, 1, 2)))
        speed = each.state.puck_velocity[:, 0, 0]
        np.testing.assert_allclose(speed, 0.2 * np.exp([-3.1 * 0.2, -0.1 * 0.2]), 1e-3)
    world.reset(1)
    state.puck[:, 0] = (-0.1, 0.0)
    world.set_state(state, memory)
    world.step(np.zeros((2, 1, 2)))
    speed = world.state.puck_velocity[:, 0, 0]
    np.testing.assert_allclose(speed, 0.2 * np.exp(-0.1 * 0.05), 1e-3)


def test_elements_are_drawn():
    options = {"obstacles": POSTS, "drag_regions": [[0.3, 0.0, 0.2, 3.0]]}
    bare, full = (
        ah.parallel_env("touch", render_mode="rgb_array", options=o)
        for o in ({}, options)
    )
    pictures = []
    for env in (bare, full):
        env.reset(seed=0)
        pictures.append(env.render())
        env.close()
    assert (pictures[0] != pictures[1]).any(-1).mean() > 0.02


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"obstacles": [[0.2, 0.0]]}, "obstacles.*3 or 5 numbers"),
        ({"obstacles": 3}, "obstacles.*3 or 5 numbers"),
        ({"obstacles": [[0.2, 0.0, -0.1]]}, "obstacles.*above 0"),
        ({"reward_regions": [[0.2, 0.0, 0.1]]}, "reward_regions.*4 numbers"),
        ({"drag_regions": [[0.2, 0.0, 0.1, 1e5]]}, r"drag must be in 0 \.\. 10 1/s"),
        ({"drag_regions": [[0.2, 0.0, 0.1, -1.0]]}, "drag_regions.*must be in 0"),
    ],
)
def test_bad_elements_are_refused_by_name(options, words):
    with pytest.raises(ValueError, match=words):
        ah.make_world("touch", options=options)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match=r"drag_regions.*one puck"):
        ah.make_world("reach", options={"drag_regions": [[0.2, 0.0, 0.1, 1.0]]})
    with pytest.raises(ValueError, match=r"obstacles.*served"):
        ah.make_world("duel", options={"obstacles": [[0.0, 0.05, 0.02]]})
    world = ah.make_world("touch", options={"obstacles": [[0.6, 0.0, 0.29]]})
    with pytest.raises(ValueError, match=r"obstacles.*no space"):
        world.reset(0)


def test_goals_in_turn_and_serves_are_clear_of_obstacles():
    world = ah.make_world("reach_sequence", 64, options={"obstacles": POSTS})
    world.reset(0)
    goals = world.memory["goals"]
    assert (rooms(world, goals, world.scene.table.paddle_radius) >= 0).all()
    posts = {"obstacles": [[0.0, 0.15, 0.04], [0.0, -0.15, 0.04]]}
    world = ah.make_world("duel", 64, options=posts)
    world.reset(0)
    for _ in range(200):
        world.step(np.zeros((64, 2, 2)))
        gap = rooms(world, world.state.puck, world.scene.table.puck_radius).min()
        assert gap > -2.5e-4


def test_goals_that_follow_from_a_shot_do_not_hinder_a_start():
    post = {"obstacles": [[0.0, 0.0, 0.03]]}
    world = ah.make_world("hit_goal_velocity", 8, options=post)
    world.reset(0)
    assert np.isfinite(world.memory["goal"]).all()


def test_a_puck_between_a_paddle_and_an_obstacle_stays_out_of_it(backend):
    posts = {"obstacles": [[-0.3, 0.0, 0.06]]}
    world = ah.make_world("duel", 1, backend=backend, options=posts)
    world.reset(0)
    state, memory = world.get_state()
    state.puck[0, 0], state.puck_velocity[:] = (-0.39275, 0.0), 0.0
    state.paddle[0, 0], state.paddle_velocity[0, 0] = (-0.57215, 0.0), (3.0, 0.0)
    world.set_state(state, memory)
    world.step(np.array([[[1.0, 0.0], [0.0, 0.0]]]))
    assert rooms(world, world.state.puck, world.scene.table.puck_radius).min() > -1e-3
    world.set_state(*world.get_state())
