"""Pictures: right sizes, right places, a window that opens."""

import numpy as np
from pair import Pair

import marl_airhockey as ah
from marl_airhockey.sim.contracts.look import CIRCLES, SEAT_COLOURS
from marl_airhockey.sim.render.picture import Frame, draw


def test_a_picture_shows_the_paddle_where_it_is(scenario):
    env = ah.parallel_env(scenario, render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture.dtype == np.uint8
    assert picture.shape[1] == 880
    low, high = env.world.scene.table.vertices[1], env.world.scene.table.vertices[3]
    x, y = env.world.state.paddle[0, 0] + 0.53 * env.world.scene.table.paddle_radius
    wide = high[0] - low[0] + 0.15
    column = round((x - low[0] + 0.075) / wide * 880)
    row = picture.shape[0] - round((y - low[1] + 0.075) / wide * 880)
    near = np.abs(picture[row, column].astype(int) - SEAT_COLOURS[0]).max()
    assert near < 12
    env.step({agent: np.ones(2) for agent in env.agents})
    assert not np.array_equal(picture, env.render())


def test_seats_have_their_own_colours():
    env = ah.parallel_env(Pair(), render_mode="rgb_array")
    env.reset(seed=0)
    colours = env.render().reshape(-1, 3)
    for colour in SEAT_COLOURS[:2]:
        assert (np.abs(colours.astype(int) - colour).max(-1) < 4).sum() > 300


def test_a_human_window_opens_and_closes():
    env = ah.parallel_env("strike", render_mode="human", control_dt=0.02)
    env.reset(seed=0)
    for _ in range(3):
        env.step({"paddle_0": np.ones(2)})
    assert env.render() is None
    env.close()


def test_a_square_block_is_drawn_rotated():
    env = ah.parallel_env("move_block", backend="pymunk", options={"shape": "square"})
    env.reset(seed=0)
    state = env.world.state.map(lambda x: x[0].copy())
    straight = draw(Frame(env.world.scene, state))
    state.angle[2] = 0.6
    assert not np.array_equal(straight, draw(Frame(env.world.scene, state)))


def test_regions_show_what_they_are():
    options = {
        "reward_regions": [[0.4, 0.2, 0.1, 1.0], [0.4, -0.2, 0.1, -1.0]],
        "drag_regions": [[0.0, 0.0, 0.2, 2.0]],
    }
    env = ah.parallel_env("hit_goal", render_mode="rgb_array", options=options)
    env.reset(seed=0)
    colours = env.render().reshape(-1, 3).astype(int)
    for means, colour in CIRCLES.items():
        assert (np.abs(colours - colour).max(-1) < 12).sum() > 60, means


def test_trail_ends_at_the_drawn_puck():
    scene = ah.make_scenario("strike").scene
    state = scene.still_state(1).map(lambda x: x[0])
    state.position[scene.bodies.puck] = [0.2, 0.1]
    plain = draw(Frame(scene, state)).astype(int)
    ahead = [[(0.05, 0.1), (0.12, 0.1), (0.35, 0.1)]]
    row, columns = np.nonzero(
        np.abs(draw(Frame(scene, state, trails=ahead)) - plain).max(-1) > 8
    )
    assert len(row) > 100
    wide = scene.table.size[0] + 0.15
    puck = round((0.2 + wide / 2) / wide * 880)
    assert columns.max() < puck
