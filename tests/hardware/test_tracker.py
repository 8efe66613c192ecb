"""The tracker of the puck, on the lab's images without real time."""

from dataclasses import replace

import numpy as np
import pytest

from marl_airhockey.hardware.camera import CameraFrame
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.lab.table_camera import Seen, TableCamera, lab_view
from marl_airhockey.hardware.lab.world import RATE, LabWorld
from marl_airhockey.hardware.table.block_tracker import BlockTracker
from marl_airhockey.hardware.table.tracker import Tracker
from marl_airhockey.hardware.vision import Colour, Detector, Sighting
from marl_airhockey.sim.core.physics import Physics

SETUP = LabSetup()
TABLE = SETUP.geometry
VIEW = lab_view(TABLE)
HOME = np.array(SETUP.home)
STILL = np.zeros(2)
EVERY = 4  # Steps of the world in a period of the camera, 30 frames/s.


@pytest.fixture(scope="module")
def colour():
    camera = TableCamera(TABLE, VIEW, np.array([-1.185, 0.0]))
    image = camera.photograph(Seen(np.array([0.3, 0.0]), STILL, HOME, STILL))
    x, y = VIEW.project(np.array([[0.3, 0.0, 0.003]]))[0]
    return Colour.around(image, (x, y))


def flights(marked, colour, scene, count=12):
    """Yield the world, its tracked state, and True at the first one of a flight."""
    camera = TableCamera(TABLE, VIEW, np.array([-1.185, 0.0]), marked=marked)
    half = tuple(TABLE.size / 2)
    detector = Detector(VIEW, colour, TABLE.puck_radius, half, marked=marked)
    world, rng = LabWorld(SETUP, 0), np.random.default_rng(0)
    tracker = Tracker(scene, Physics(scene.defaults, "ur5e"))
    for _ in range(count):
        heading = rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.2)
        velocity = 1.5 * np.array([np.cos(heading), np.sin(heading)])
        world.put(np.array([0.2, 0.0]), velocity, held=False)
        turn = np.array([[0.0, rng.uniform(-25.0, 25.0)]])
        world._state = world._begin(replace(world._state, spin=turn))
        start = world.time
        seen = []
        tracker.forget()
        for k in range(1, int(0.8 * RATE)):
            world.step(HOME, STILL, 0.0)
            if k % EVERY:
                continue
            turn = world.puck_angle, world.puck_spin
            view = Seen(world.puck, world.puck_velocity, HOME, STILL, *turn)
            frame = CameraFrame(camera.photograph(view, k), world.time, k)
            seen.append(detector.find(frame))
            if len(seen) == 2:
                tracker.begin(seen)
            elif len(seen) > 2:
                path = np.zeros((1, 11, scene.bodies.movers, 4))
                state = replace(scene.still_state(1), path=path)
                track = np.array([[start, *HOME], [world.time, *HOME]])
                now = world.time
                tracker.fill(state, seen[-1:], track, now, now - EVERY / RATE)
                yield world, state, len(seen) == 3


def spins(marked, colour):
    """True and estimated spins (n,), rad/s, after bounces off the long sides."""
    scene = LabWorld(SETUP, 0).scene
    pairs = [
        (world.puck_spin, float(state.spin[0, 1]))
        for world, state, _ in flights(marked, colour, scene)
    ]
    return np.array(pairs).T


def test_the_spin_of_a_marked_puck_is_tracked(colour):
    true, found = spins(True, colour)
    assert true.std() > 2.0
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.35 * true.std()
    assert np.median(np.abs(found - true)) < 0.5


def test_the_spin_of_a_puck_without_a_mark_is_not_known(colour):
    true, found = spins(False, colour)
    assert np.isfinite(found).all()
    assert np.median(np.abs(found - true)) > 3.0


def test_a_path_ends_at_the_newest_frame_and_has_no_gap(colour):
    scene = replace(LabWorld(SETUP, 0).scene, path=True)
    before, off = None, []
    for world, state, begins in flights(False, colour, scene):
        path = state.path[0, :, 1]
        off.append(np.linalg.norm(path[-1, :2] - world.puck))
        assert np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).max() < 0.03
        assert begins or np.array_equal(before, path[0])
        before = path[-1]
    assert np.median(off) < 0.002
    assert max(off) < 0.02


def test_a_path_without_a_new_frame_is_a_point(colour):
    scene = replace(LabWorld(SETUP, 0).scene, path=True)
    tracker = Tracker(scene, Physics(scene.defaults, "ur5e"))
    first, second = (
        Sighting(np.array([x, 0.0]), t, 1.0, STILL) for x, t in ((0.0, 0.0), (0.1, 0.1))
    )
    tracker.begin([first, second])
    state = replace(scene.still_state(1), path=np.zeros((1, 11, 2, 4)))
    tracker.fill(state, [], np.array([[0.0, *HOME], [0.2, *HOME]]), 0.2, 0.15)
    assert state.puck[0, 0, 0] > 0.15  # It is predicted for now,
    assert (
        state.path[0, :, 1] == (0.1, 0.0, 1.0, 0.0)
    ).all()  # but was not seen there.


def test_a_block_rests_until_it_is_hit_and_then_follows():
    """Track a block on the images of a puck that flies at it."""
    setup = LabSetup(block=True)
    world, start = LabWorld(setup, 0), np.array([0.3, 0.1])
    camera = TableCamera(TABLE, VIEW, np.array([-1.185, 0.0]))

    def frame():
        seen = Seen(world.puck, world.puck_velocity, HOME, STILL, block=world.block)
        return CameraFrame(camera.photograph(seen), world.time, 0)

    world.put(np.array([-0.1, 0.1]), np.array([1.5, 0.0]), held=False, block=start)
    x, y = VIEW.project(np.array([[*start, 0.003]]))[0]
    blue = Colour.around(frame().image, (x, y))
    half = tuple(TABLE.size / 2)
    detector = Detector(VIEW, blue, world.scene.block_radius, half)
    tracker, state = BlockTracker(), world.scene.still_state(1)
    tracker.begin(detector.find(frame()))
    rests = 0
    for k in range(1, int(1.2 * RATE)):
        world.step(HOME, STILL, 0.0)
        if k % EVERY:
            continue
        tracker.fill(state, [detector.find(frame())])
        place, velocity = world.block
        assert np.linalg.norm(state.block[0, 0] - place) < 0.004
        if (place == start).all():
            rests += 1
            assert not state.block_velocity.any()
        else:
            # A mean over the period of the camera.
            off = np.linalg.norm(state.block_velocity[0, 0] - velocity)
            assert off < 0.1 + 0.6 * np.linalg.norm(velocity)
    assert rests > 3
    assert np.linalg.norm(place - start) > 0.05
