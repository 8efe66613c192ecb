"""Physics that every 2D backend owes: closed forms, and what must never happen."""

import numpy as np
import pytest
from bench import DT, TABLE, Bench
from hypothesis import given, settings
from hypothesis import strategies as st
from names import ideal_backends
from pair import Pair

import marl_airhockey as ah
from marl_airhockey.registry import find_backend
from marl_airhockey.sim.contracts.backend import Command
from marl_airhockey.sim.core.parameters import PARAMETERS, PUCK_SPEED_CAP
from marl_airhockey.sim.core.scene import GoalLine, Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import GRAVITY, Obstacle, Table
from marl_airhockey.toolkit.starts import roll


@pytest.mark.parametrize("speed", [0.02, 0.1, 0.3, 1.0, 3.0, 4.9])
def test_a_wall_returns_its_share_of_the_normal_speed(backend, speed):
    bench = Bench(backend)
    bench.reset((-0.6, -0.1), (0.0, 0.1, 0.5 * speed, 0.8 * speed))
    states = bench.run(0.25 / speed + 3 * DT)
    last = next(s for s in states if s.puck_velocity[0, 0, 1] < 0)
    np.testing.assert_allclose(last.puck_velocity[0, 0, 1], -0.9 * 0.8 * speed, 1e-6)
    np.testing.assert_allclose(last.puck_velocity[0, 0, 0], 0.5 * speed, 1e-6)


@pytest.mark.parametrize("speed", [0.02, 0.1, 0.3, 1.0, 3.0, 4.9])
def test_a_still_paddle_returns_its_share(backend, speed):
    bench = Bench(backend)
    bench.reset((-0.6, 0.0), (-0.4, 0.0, -speed, 0.0))
    states = bench.run(0.13 / speed + 2 * DT)
    np.testing.assert_allclose(states[-1].puck_velocity[0, 0], [0.85 * speed, 0], 1e-6)
    assert sum(s.touched[0, 0, 0] for s in states) == 1
    at = [s.touched_at[0, 0, 0] for s in states if s.touched[0, 0, 0]]
    assert 0 < at[0] <= DT


def test_a_moving_paddle_strikes_and_is_not_pushed_back(backend):
    bench = Bench(backend)
    bench.reset((-0.7, 0.0), (-0.45, 0.0, 0.0, 0.0))
    states = bench.run(0.5, velocity=(0.7, 0.0))
    np.testing.assert_allclose(
        states[-1].puck_velocity[0, 0], [1.85 * 0.7, 0], atol=1e-9
    )
    # The first step ramps up: it covers half of what a full one does.
    np.testing.assert_allclose(states[-1].paddle[0, 0, 0], -0.7 + 0.7 * 9.5 * DT, 1e-9)


def test_a_puck_moves_a_block_by_mass_and_restitution(backend):
    bench = Bench(backend, {"block_friction": 0.0}, blocks=1)
    bench.reset((-0.7, 0.0), (0.0, 0.0, 1.0, 0.0), (0.3, 0.0, 0.0, 0.0))
    last = bench.run(0.6)[-1]
    np.testing.assert_allclose(last.block_velocity[0, 0, 0], 1.9 / 3, rtol=1e-6)
    np.testing.assert_allclose(last.puck_velocity[0, 0, 0], 1 - 2 * 1.9 / 3, rtol=1e-6)


def test_a_sliding_block_stops_by_coulomb_friction_and_rests_on_a_slope(backend):
    bench = Bench(backend, {"tilt": 5.5}, pucks=0, blocks=1)
    pull = GRAVITY * np.sin(np.radians(5.5))
    bench.reset((-0.7, 0.0), (0.0, 0.0, 1.0, 0.0))
    states = bench.run(1.0)
    way = states[-1].block[0, 0, 0]
    np.testing.assert_allclose(way, 1.0 / (2 * (2.4 + pull)), rtol=0.03)
    bench.reset((-0.7, 0.0), (0.3, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(bench.run(2.0)[-1].block[0, 0], [0.3, 0.0])


def test_a_falling_puck_follows_its_parabola(backend):
    bench = Bench(backend, {"tilt": 5.5})
    pull = GRAVITY * np.sin(np.radians(5.5))
    bench.reset((-0.7, 0.2), (0.5, -0.2, 0.3, 0.05))
    for state in bench.run(1.5):
        t = state.time[0]
        np.testing.assert_allclose(
            state.puck[0, 0],
            [0.5 + 0.3 * t - pull * t * t / 2, -0.2 + 0.05 * t],
            atol=1e-6,
        )
        np.testing.assert_allclose(
            state.puck_velocity[0, 0, 0], 0.3 - pull * t, atol=1e-6
        )


def test_drag_decays_the_speed_exponentially(backend):
    bench = Bench(backend, {"puck_damping": 0.8})
    bench.reset((-0.7, 0.2), (-0.3, 0.0, 0.5, 0.0))
    for state in bench.run(1.5):
        t = state.time[0]
        np.testing.assert_allclose(
            state.puck_velocity[0, 0, 0], 0.5 * np.exp(-0.8 * t), 1e-6
        )


def test_a_way_that_is_rolled_out_agrees(backend):
    physics = {name: p.default for name, p in PARAMETERS.items()}
    bench = Bench(backend, physics)
    start = np.array([[-0.3, 0.1, 1.3, 0.9, 0.0]])
    bench.reset((-0.7, -0.2), start[0, :4])
    states = bench.run(1.5)
    way = roll(start, DT / 10, 301, 0.3048 - 0.03175, physics)[0, 10::10]
    found = np.array([s.puck[0, 0] for s in states])
    # A bank is found up to a substep late.
    assert np.abs(found - way[:, :2]).max() < 0.9 * DT / 10 * 2
    found = np.array([s.puck_edge[0, 0] for s in states])
    np.testing.assert_allclose(found, way[:, 4], atol=0.02)


@pytest.mark.parametrize("shape", ["disc", "square"])
def test_blocks_of_both_shapes_are_moved_and_stop(backend, shape):
    bench = Bench(backend, blocks=1, block_shape=shape)
    if bench.refused:
        assert "pymunk" in bench.refused
        return
    bench.reset((-0.7, 0.0), (0.0, 0.012, 1.5, 0.0), (0.3, 0.0, 0.0, 0.0))
    states = bench.run(2.0)
    assert 0.02 < states[-1].block[0, 0, 0] - 0.3 < 0.5
    np.testing.assert_allclose(states[-1].block_velocity[0, 0], 0.0, atol=1e-9)
    assert (states[-1].angle[0, 2] != 0) == (shape == "square")
    np.testing.assert_allclose(states[-1].spin[0, 2], 0.0, atol=1e-9)


def test_a_puck_in_a_goal_mouth_is_out_until_it_is_served(backend):
    goal_lines = (GoalLine("far", 2, 0.30), GoalLine("home", 0))
    bench = Bench(backend, goal_lines=goal_lines)
    bench.reset((-0.7, 0.0), (0.6, 0.05, 2.0, 0.0))
    states = bench.run(0.6)
    crossed = [s.crossed[0, 0] for s in states]
    assert [tuple(c) for c in crossed if c.any()] == [(True, False)]
    k = next(i for i, c in enumerate(crossed) if c.any())
    np.testing.assert_allclose(
        states[k].crossed_velocity[0, 0, 0], [2.0, 0.0], atol=1e-6
    )
    for state in states[k:]:
        assert 0.838 < state.puck[0, 0, 0] < 0.88
        np.testing.assert_array_equal(state.puck_velocity[0, 0], 0.0)
    bench.reset((-0.7, 0.0), (0.0, 0.0, -1.0, 0.2))
    states = bench.run(1.0)
    home = [i for i, s in enumerate(states) if s.crossed[0, 0, 1]]
    assert home
    assert not any(s.crossed[0, 0, 0] for s in states)
    assert states[-1].puck_velocity[0, 0, 0] > 0


def test_a_shot_beside_the_mouth_bounces(backend):
    bench = Bench(backend, goal_lines=(GoalLine("far", 2, 0.30),))
    bench.reset((-0.7, 0.0), (0.6, 0.22, 1.5, 0.0))
    states = bench.run(0.6)
    assert not any(s.crossed.any() for s in states)
    np.testing.assert_allclose(states[-1].puck_velocity[0, 0, 0], -0.9 * 1.5, 1e-6)


def test_obstacles_are_solid(backend):
    post = Obstacle((0.2, 0.0), 0.05)
    bench = Bench(backend, obstacles=(post,))
    bench.reset((-0.7, 0.2), (-0.2, 0.0, 1.0, 0.0))
    last = bench.run(1.0)[-1]
    np.testing.assert_allclose(last.puck_velocity[0, 0], [-0.9, 0.0], atol=1e-6)
    np.testing.assert_array_equal(last.position[0, -1], [0.2, 0.0])


def test_a_prescribed_paddle_follows_and_too_fast_is_lifted(backend):
    bench = Bench(backend)
    bench.reset((-0.6, 0.0), (-0.5, 0.0, 0.0, 0.0))
    prescribed = np.array([[[-0.55, 0.02, 0.3, 0.1]]])
    state = bench.backend.step(bench.command(prescribed=prescribed))
    np.testing.assert_allclose(state.paddle[0, 0], prescribed[0, 0, :2], atol=1e-12)
    np.testing.assert_allclose(
        state.paddle_velocity[0, 0], prescribed[0, 0, 2:], atol=1e-12
    )
    bench.reset((-0.6, 0.0), (-0.4, 0.0, 0.0, 0.0))
    prescribed = np.array([[[0.1, 0.0, 0.0, 0.0]]])
    state = bench.backend.step(bench.command(prescribed=prescribed))
    np.testing.assert_allclose(state.paddle[0, 0], [0.1, 0.0], atol=1e-12)
    assert not state.touched.any()
    np.testing.assert_allclose(state.puck[0, 0], [-0.4, 0.0], atol=1e-12)


def energy(state, pull):
    """(B,) kinetic and potential energy of the pucks by mass, m2/s2."""
    v, x = state.puck_velocity, state.puck[..., 0]
    return (0.5 * (v * v).sum(-1) + pull * x).sum(-1)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    pucks=st.integers(1, 3),
    tilt=st.floats(0, 12),
    restitution=st.floats(0.3, 1.0),
)
def test_energy_never_rises_without_a_paddle(seed, pucks, tilt, restitution):
    for backend in ideal_backends():
        physics = {"tilt": tilt, "wall_restitution": restitution, "puck_damping": 0.05}
        bench = Bench(backend, physics, pucks=pucks)
        rng = np.random.default_rng(seed)
        rows = [
            (0.25 * k, rng.uniform(-0.2, 0.2), *rng.uniform(-2, 2, 2))
            for k in range(pucks)
        ]
        start = bench.reset((-0.75, 0.25), *rows)
        pull = GRAVITY * np.sin(np.radians(tilt))
        before = energy(start, pull)
        for state in bench.run(3.0):
            if state.touched.any() or state.touching.any():
                break
            now = energy(state, pull)
            # Overlap of a substep is taken back against the slope, and a contact sees
            # the velocity of half a substep earlier.
            slack = pucks * pull * (4.0 * DT / 10 + 0.002) + 1e-9
            assert (now <= before + slack).all()
            before = np.minimum(before, now)


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    seats=st.sampled_from(["robot", "arcade"]),
    chase=st.floats(0, 1),
    delay=st.sampled_from([0.0, 0.05, 0.08]),
)
def test_whatever_the_actions_nothing_impossible_happens(seed, seats, chase, delay):
    """Reach, acceleration, table, speeds and separate paddles, two seats, a goal."""
    for backend in ideal_backends():
        world = ah.make_world(
            Pair(seats=seats), 4, backend=backend, physics={"action_delay": delay}
        )
        world.reset(seed)
        rng = np.random.default_rng(seed)
        speed = world.physics.highest("paddle_speed")
        most = world.physics.highest("paddle_acceleration") * DT
        half = TABLE.size / 2
        for k in range(120):
            if k % 7 == 0:
                wild = rng.uniform(-1, 1, (4, 2, 2)) * rng.choice([1, 3])
            gap = world.state.puck - world.state.paddle
            gap[:, 1] *= -1
            actions = np.where(rng.random((4, 2, 1)) < chase, 10 * gap, wild)
            before = world.state
            step = world.step(actions)
            live = ~(step.terminated | step.truncated)
            after = world.state
            live &= after.time > before.time
            moved = after.paddle_velocity - before.paddle_velocity
            size = np.linalg.norm(moved, axis=-1)
            # What stands in a paddle's way, or the edge of its reach, stops it at once.
            pace = np.linalg.norm(after.paddle_velocity, axis=-1)
            slower = pace <= np.linalg.norm(before.paddle_velocity, axis=-1) + most
            assert ((size <= most * (1 + 1e-9)) | slower)[live].all()
            inside = np.einsum("skd,bsd->bsk", world.reach.normals, after.paddle)
            assert (inside + world.reach.offsets >= -1e-9).all()
            top = np.linalg.norm(after.paddle_velocity, axis=-1)
            assert (top <= speed * (1 + 1e-9)).all()
            apart = np.linalg.norm(after.paddle[:, 0] - after.paddle[:, 1], axis=-1)
            assert (apart >= 2 * TABLE.paddle_radius - 2.1e-4).all()
            # pymunk: nothing moves more than a third of a radius in a substep.
            slack = 0.002 + TABLE.puck_radius / 3 - TABLE.puck_radius
            lane = np.abs(after.puck[..., 1]) > 0.15
            assert (np.abs(after.puck[..., 1]) <= half[1] + slack).all()
            assert (np.abs(after.puck[..., 0]) <= half[0] + slack)[lane].all()
            pace = np.linalg.norm(after.puck_velocity, axis=-1)
            assert (pace <= PUCK_SPEED_CAP + 1e-6).all()


def test_two_paddles_meet_and_share_their_normal_speed(backend):
    seat = make_seat("arcade", TABLE, 0)
    kind = find_backend(backend)
    scene = Scene(TABLE, (seat, seat))
    table = kind(scene, 1, DT)
    state = scene.still_state(1)
    state.position[0] = [(-0.5, 0.0), (-0.3, 0.0)]
    table.reset(state, np.arange(1))
    pushing = Command.still(scene, 1)
    pushing.velocity[0] = [(1.0, 0.3), (-0.4, 0.0)]
    met = 0
    for _ in range(12):
        state = table.step(pushing)
        gap = np.linalg.norm(state.paddle[0, 0] - state.paddle[0, 1])
        assert gap >= 2 * TABLE.paddle_radius - 2.1e-4
        # Where they slide on each other, they part as a tangent does from its circle.
        if gap > 2 * TABLE.paddle_radius + 4e-4:
            continue
        met += 1
        normal = (state.paddle[0, 1] - state.paddle[0, 0]) / gap
        along, across = normal, np.array([-normal[1], normal[0]])
        one, two = state.paddle_velocity[0]
        # Both are commanded along x and y of their own; in contact neither goes into
        # the other, and what they have across the contact stays theirs.
        assert one @ along == pytest.approx(two @ along, abs=0.06)
        assert abs(one @ across - two @ across) > 0.05
    assert met >= 2


def test_a_squeezed_puck_slips_away(backend):
    bench = Bench(backend)
    bench.reset((-0.55, 0.0), (-0.55, 0.24, 0.0, 0.0))
    fastest = 0.0
    for _ in range(3):
        for state in bench.run(0.35, velocity=(0.0, 0.7)) + bench.run(
            0.35, (0.0, -0.7)
        ):
            assert np.abs(state.puck[0, 0, 1]) <= 0.3048
            fastest = max(fastest, np.linalg.norm(state.puck_velocity[0, 0]))
    assert fastest <= PUCK_SPEED_CAP + 1e-9


@pytest.mark.parametrize("sides", [3, 4, 5])
def test_pucks_stay_on_a_regular_polygon(backend, sides):
    table = Table.regular(sides, 0.45)
    seats = tuple(
        make_seat("arcade", table, k, tuple(range(sides))) for k in range(sides)
    )
    kind = find_backend(backend)
    scene = Scene(table, seats, pucks=2)
    world = kind(scene, 1, DT)
    state = scene.still_state(1)
    for k, seat in enumerate(seats):
        middle = np.mean(seat.reach, axis=0)
        state.position[0, k] = middle @ table.rotation(seat.side)
    state.velocity[0, sides:] = [(2.0, 0.7), (-1.1, 1.9)]
    state.position[0, sides:] = [(0.05, 0.0), (-0.05, 0.0)]
    world.reset(state, np.arange(1))
    still = Command.still(scene, 1)
    for _ in range(200):
        state = world.step(still)
        depth = state.puck[0] @ table.normals.T + table.offsets
        assert (depth > 0).all()


def test_two_blocks_meet_with_the_restitution_of_blocks(backend):
    bench = Bench(backend, {"block_friction": 0.0}, blocks=2)
    bench.reset(
        (-0.7, 0.0), (0.0, 0.25, 0.0, 0.0), (-0.1, 0.0, 1.0, 0.0), (0.1, 0.0, 0.0, 0.0)
    )
    last = bench.run(0.3)[-1]
    np.testing.assert_allclose(
        last.block_velocity[0, :, 0], [0.5 * 0.1, 0.5 * 1.9], rtol=1e-6
    )
    bench.reset(
        (-0.7, 0.0), (0.0, 0.25, 0.0, 0.0), (0.6, 0.0, 1.0, 0.0), (0.1, 0.0, 0.0, 0.0)
    )
    last = bench.run(0.4)[-1]
    np.testing.assert_allclose(last.block_velocity[0, 0, 0], -0.9, rtol=1e-6)


@pytest.mark.parametrize(("axis", "sides"), [(0, (2, 0)), (1, (3, 1))])
def test_bounces_off_each_side_are_counted(backend, axis, sides):
    bench = Bench(backend, {"wall_restitution": 1.0}, goal_lines=(GoalLine("far", 2),))
    velocity = 1.5 * np.eye(2)[axis]
    bench.reset((-0.75, 0.25), (0.0, 0.0, *velocity))
    banked, crossed = np.zeros(4, int), 0
    for state in bench.run(3.9):
        banked += state.banked[0, 0]
        crossed += int(state.crossed[0, 0, 0])
    # Without losses it meets a wall every time that it has crossed the table.
    travels = 3.9 * 1.5 / (TABLE.size[axis] - 2 * TABLE.puck_radius)
    met = int(travels + 0.5)
    first, second = sides
    assert (banked[first], banked[second]) == ((met + 1) // 2, met // 2)
    assert banked.sum() == met
    assert crossed == banked[2], "a goal line that is a whole side is crossed by it"


def test_a_puck_that_rests_on_a_wall_does_not_bounce(backend):
    bench = Bench(backend, {"tilt": 5.5, "wall_restitution": 0.5})
    home = -TABLE.size[0] / 2 + TABLE.puck_radius
    bench.reset((-0.5, 0.25), (home - 5e-5, 0.0, 0.0, 0.0))
    assert sum(state.banked.sum() for state in bench.run(1.0)) == 0
