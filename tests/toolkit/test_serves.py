"""Serves: every accepted number of pucks starts, and is served, on the table."""

import numpy as np
import pytest
from situations import idle

import marl_airhockey as ah
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.toolkit.serves import GAP, most_served, serve

pytestmark = pytest.mark.usefixtures("uncompiled")
GAMES = ["duel", "doubles"]


def streams(worlds):
    return RandomStreams.keyed(np.arange(worlds), np.zeros(worlds, int), "start")


def room(scene, state):
    """(W, pucks) distance of each puck to the nearest side, obstacle or body, m."""
    table, radii = scene.table, np.array(state.bodies.radius)
    puck = state.puck
    sides = (puck @ table.normals.T + table.offsets).min(-1) - table.puck_radius
    apart = np.linalg.norm(puck[:, :, None] - state.position[:, None], axis=-1)
    apart -= radii + table.puck_radius
    first = state.bodies.puck.start
    apart[:, range(scene.pucks), range(first, first + scene.pucks)] = np.inf
    return np.minimum(sides, apart.min(-1))


@pytest.mark.parametrize("game", GAMES)
@pytest.mark.parametrize("table", ["standard", "full_size"])
def test_every_number_of_pucks_starts_on_the_table(game, table):
    most = most_served(ah.make_scenario(game, table=table).scene)
    assert most >= 20
    for pucks in range(1, most + 1):
        made = ah.make_scenario(game, table=table, pucks=pucks)
        state, _ = made.reset(streams(4), 4)
        assert room(made.scene, state).min() >= GAP - 1e-9, pucks
    with pytest.raises(
        ValueError, match=f"pucks: {most + 1} do not fit.*at most {most}"
    ):
        ah.make_scenario(game, table=table, pucks=most + 1)


def test_pucks_are_served_side_by_side_in_the_middle():
    made = ah.make_scenario("duel", pucks=2)
    state, _ = made.reset(streams(3), 3)
    np.testing.assert_allclose(state.puck, [[(0.0, -0.06), (0.0, 0.06)]] * 3)
    assert (state.puck_velocity[:, 0, 0] * state.puck_velocity[:, 1, 0] < 0.0).all()


@pytest.mark.parametrize("game", GAMES)
def test_pucks_are_served_clear_of_what_is_in_the_way(game):
    made = ah.make_scenario(game, pucks=8)
    scene, rng = made.scene, streams(64)
    state, _ = made.reset(rng, 64)
    # Paddles and other pucks anywhere around the middle.
    crowd = np.random.default_rng(0).uniform((-0.2, -0.22), (0.2, 0.22), (64, 12, 2))
    state.position[:] = crowd[:, : len(scene.bodies)]
    for k in range(8):
        serve(rng, scene, state, k, np.zeros(64))
        assert room(scene, state)[:, k].min() >= GAP - 1e-9, k


def test_a_scored_puck_comes_back_beside_the_others(backend):
    world = ah.make_world("duel", 2, backend=backend, options={"pucks": 4})
    world.reset(0)
    rows, memory = world.get_state()
    rows.velocity[:] = 0.0
    rows.puck[:] = [(0.7, 0.0), (0.0, -0.06), (0.0, 0.06), (0.0, 0.18)]
    rows.puck_velocity[:, 0] = (2.0, 0.0)
    world.set_state(rows, memory)
    idle(world, 0.2)
    assert (world.memory["goals"] == [1, 0]).all()
    assert (np.abs(world.state.puck[:, 0, 0]) < 0.13).all()
    assert room(world.scene, world.state).min() > 0.0


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("doubles", {"apart": 0.6}, "apart: 0.6 m; expected"),
        ("doubles", {"apart": 0.05}, "apart: 0.05 m"),
        ("free_for_all", {"sides": 24, "goal_width": 0.05}, "sides: 24 paddles"),
        ("duel", {"pucks": 2.0}, "pucks: 2.0 must be a whole number"),
    ],
)
def test_games_that_cannot_begin_are_refused(name, options, words):
    with pytest.raises(ValueError, match=words):
        ah.make_world(name, 1, options=options)


def test_numbers_of_numpy_are_numbers():
    assert ah.make_world("duel", 1, options={"pucks": np.int64(2)}).scene.pucks == 2
