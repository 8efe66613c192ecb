"""Contacts where there is no room, and what they may do to energy."""

import numpy as np
import pytest
from pressing import overlap, press, press_world

import marl_airhockey as ah
from marl_airhockey.build import LONGEST_STEP
from marl_airhockey.sim.contracts.backend import Command

pytestmark = pytest.mark.usefixtures("uncompiled")

RADIUS = 0.03175


def cornered(world, seed=0):
    """Put pucks near corners, paddles before them."""
    scene, worlds = world.scene, world.num_worlds
    rng = np.random.default_rng(seed)
    corners = np.asarray(scene.table.vertices)
    where = corners[np.arange(worlds) % len(corners)]
    state = world.state
    near = (0.5, 0.13) if len(corners) == 3 else (0.58, 0.21)
    for k in range(scene.pucks):
        spread = rng.normal(0.0, 0.01, (worlds, 2))
        state.puck[:, k] = where * (near[0] + near[1] * k) + spread
    aside = np.stack([-where[:, 1], where[:, 0]], 1)
    seats = len(scene.seats)
    for i in range(seats):
        state.paddle[:, i] = 0.1 * where + aside * 0.25 * (2 * i - 1) * (seats > 1)
    world.set_state(state)


# Every number of corners is compiled anew.
MORE_CORNERS = [pytest.param(count, marks=pytest.mark.slow) for count in (4, 5, 8)]


@pytest.mark.parametrize("preset", ["professional", "frictionless"])
@pytest.mark.parametrize("limits", ["robot", "arcade"])
@pytest.mark.parametrize("corners", [3, *MORE_CORNERS])
def test_nothing_overlaps_in_a_corner(corners, limits, preset):
    for paddles, pucks in ((2, 1), (1, 2)):
        options = {"paddles": paddles, "pucks": pucks, "limits": limits}
        world = press_world(40, physics=preset, corners=corners, **options)
        cornered(world)
        for state in press(world, 5.0):
            assert overlap(world.scene, state).max() < 2.5e-4
            assert np.isfinite(state.position).all()


def test_no_paddle_overlaps_a_puck_in_the_longest_control_step():
    options = {"reaction": 0.0}
    world = ah.make_world("duel", 128, control_dt=LONGEST_STEP, options=options)
    world.reset(0)
    rng, scene = np.random.default_rng(0), world.scene
    seats, toward = len(scene.seats), np.array([1.0, -1.0])[:, None]
    touch = scene.bodies.radius[0] + scene.bodies.radius[seats]
    for _ in range(round(30.0 / LONGEST_STEP)):
        state = world.state
        ego = (state.puck - state.paddle) * toward
        noise = rng.normal(0.0, 0.1, ego.shape)
        world.step(np.clip(ego * rng.uniform(1.0, 20.0) + noise, -1.0, 1.0))
        gap = np.linalg.norm(world.state.paddle - world.state.puck, axis=-1)
        assert gap.min() > touch - 2.5e-4


def test_pymunk_leaves_no_overlap_for_two_steps():
    world = press_world(8, "pymunk", corners=4, paddles=2, limits="arcade")
    cornered(world)
    last = np.zeros(8, np.bool_)
    for state in press(world, 2.0):
        now = overlap(world.scene, state) > 1e-3
        assert not (now & last).any()
        last = now


def test_a_paddle_that_cannot_go_on_stops_and_says_so(backend):
    world = press_world(1, backend, limits="robot", tilt=0.0)
    state = world.state
    wall = -world.scene.table.offsets[0]
    state.puck[0, 0] = (wall + RADIUS, 0.0)
    state.paddle[0, 0] = (wall + 2 * RADIUS + world.scene.table.paddle_radius + 0.02, 0)
    world.set_state(state)
    for _ in range(30):
        result = world.step(np.array([[[-1.0, 0.0]]]))
    gap = np.hypot(*(world.state.paddle - world.state.puck)[0, 0])
    assert gap > RADIUS + world.scene.table.paddle_radius - 1e-3
    assert np.abs(result.applied_action).max() < 0.35
    np.testing.assert_allclose(
        result.applied_action[0, 0], world.state.paddle_velocity[0, 0] / 0.7, atol=1e-6
    )


@pytest.mark.parametrize(
    ("friction", "tilt", "blocks"),
    [
        (0.0, 5.5, 0),
        (0.3, 5.5, 6),
        pytest.param(0.0, 0.0, 0, marks=pytest.mark.slow),
        pytest.param(0.3, 5.5, 0, marks=pytest.mark.slow),
        pytest.param(0.0, 0.0, 6, marks=pytest.mark.slow),
        pytest.param(0.0, 5.5, 6, marks=pytest.mark.slow),
    ],
)
def test_energy_comes_from_nowhere_and_goes_nowhere(friction, tilt, blocks):
    physics = {
        **{
            "preset": "frictionless",
            "wall_restitution": 1.0,
            "paddle_restitution": 1.0,
        },
        **{"block_restitution": 1.0, "block_friction": 0.0, "block_mass": 0.03},
        **{f"{name}_friction": friction for name in ("wall", "paddle", "puck")},
    }
    options = {"corners": 5, "pucks": 3, "blocks": blocks, "tilt": tilt}
    world = press_world(20, physics=physics, **options)
    state, rng, count = world.state, np.random.default_rng(4), 3 + blocks
    angle = 2 * np.pi * np.arange(count) / count
    state.paddle[:] = 0.0
    state.position[:, 1:] = 0.25 * np.stack([np.cos(angle), np.sin(angle)], -1)
    state.velocity[:, 1:] = rng.uniform(-2, 2, (20, count, 2))
    world.set_state(state)
    backend, still = world.backend, Command.still(world.scene, 20)
    pull = 9.81 * np.sin(np.radians(tilt))

    def energy(state):
        moving = 0.5 * (state.velocity[:, 1:] ** 2).sum((1, 2))
        spinning = 0.25 * ((RADIUS * state.spin[:, 1:4]) ** 2).sum(1)
        return moving + spinning + pull * state.position[:, 1:, 0].sum(1)

    state = world.state
    backend.reset(state, np.arange(20))
    last = first = energy(state)
    scale = np.median(first + 0.45 * pull * count)
    for _ in range(1200):
        state = backend.step(still)
        now = energy(state)
        assert (now < last + 1e-9 * scale).all()
        last = now
    assert np.isfinite(last).all()
    if friction == 0.0:
        assert (last > first - 1e-3 * scale).all()


def test_a_squeeze_ejects_no_faster_than_repeated_bounces():
    e, wall = 0.5, 0.85 - 0.02 * np.log(0.4)
    most = 1.15 * (1 + e) / (1 - e * wall)
    for speed in (0.1, 0.5, 2.5):
        world = press_world(100, physics="professional", limits="arcade", tilt=0.0)
        state, rng = world.state, np.random.default_rng(1)
        edge, touch = -world.scene.table.offsets[0], RADIUS + 0.047625
        state.puck[:, 0, 0] = edge + RADIUS + 0.002
        state.puck[:, 0, 1] = rng.uniform(-0.5, 0.5, 100) * RADIUS
        state.paddle[:, 0] = (edge + RADIUS + touch + 0.03, 0.0)
        state.paddle_velocity[:, 0] = (-speed, 0.0)
        world.set_state(state)
        for _ in range(round(0.06 / speed / 0.05) + 10):
            world.step(np.full((100, 1, 2), (-speed / 5.0, 0.0)))
            pace = np.hypot(*np.moveaxis(world.state.puck_velocity[:, 0], -1, 0))
            assert (pace <= most * speed).all()


def test_a_prescribed_paddle_lifts_a_puck_that_has_no_room(backend):
    world = press_world(1, backend, limits="arcade", tilt=0.0)
    state, table = world.state, world.scene.table
    corner = np.asarray(table.vertices[1])
    state.puck[0, 0] = corner * (1 - 1.5 * RADIUS / 0.45)
    state.paddle[0, 0] = 0.3 * corner
    backend_, still = world.backend, Command.still(world.scene, 1)
    backend_.reset(state, np.arange(1))
    lifted, goal = [], corner * (1 - 1.4 * table.paddle_radius / 0.45)
    for k in range(1, 21):
        place = 0.3 * corner + (goal - 0.3 * corner) * min(k / 10, 1.0)
        still.prescribed[0, 0] = (*place, 0.0, 0.0)
        lifted.append(bool(backend_.step(still).lifted[0, 0]))
    # On pymunk it may slip away; nowhere may it stay where there is no room.
    gap = np.hypot(*(goal - backend_.step(still).puck[0, 0]))
    assert sum(lifted) == 1 or gap > RADIUS + table.paddle_radius - 1e-3
    assert sum(lifted) == 1 or backend == "pymunk"
    assert not any(lifted[:9])
