"""Observations that are images: their look, their seats, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.sim.contracts.image_form import ImageForm, image_form
from marl_airhockey.sim.contracts.look import ROOM, mark_shapes
from marl_airhockey.sim.render.picture import Frame, shapes_of
from marl_airhockey.sim.sensing.images.images import Moving
from marl_airhockey.sim.sensing.images.templates import USUAL_WIDTH, scale_of

SMALL = "pixels:size=48,colour=rgb,frames=1"
SAMPLES = 16
"""Samples per pixel along each axis of a reference image."""
SQUARES = {"backend": "pymunk", "options": {"shape": "square"}}
REGIONS = {
    "reward_regions": [[0.4, 0.2, 0.1, 1.0], [0.4, -0.2, 0.1, -1.0]],
    "drag_regions": [[0.0, 0.0, 0.2, 2.0]],
}


def inside(shape, x, y, unit):
    """Return the points in a shape, and in the inner part of a disc."""
    points, half = shape.points, shape.line * unit / 2
    if len(points) == 1:
        distance = np.hypot(x - points[0, 0], y - points[0, 1])
        disc = distance < shape.radius
        return (np.abs(distance - shape.radius) < half if half else disc), disc
    near, within = np.zeros(x.shape, np.bool_), np.ones(x.shape, np.bool_)
    ahead = np.roll(points, -1, 0) - points
    turn = np.sign(ahead[0, 0] * ahead[1, 1] - ahead[0, 1] * ahead[1, 0])
    for (px, py), (dx, dy) in zip(points, ahead, strict=True):
        along = np.clip(
            ((x - px) * dx + (y - py) * dy) / max(dx * dx + dy * dy, 1e-12), 0, 1
        )
        near |= np.hypot(x - px - along * dx, y - py - along * dy) < half
        within &= turn * (dx * (y - py) - dy * (x - px)) > 0
    return (near if half else within), within


def reference(frame, form):
    """Return an image of many samples per pixel of the shapes of a video."""
    scale = scale_of(frame.scene, form)
    count, unit = form.size * SAMPLES, form.size / scale / USUAL_WIDTH
    axis = ((np.arange(count) + 0.5) / SAMPLES - form.size / 2) / scale
    # Random samples in each cell, because edges along an axis would cut all or none.
    jitter = np.random.default_rng(0).uniform(-0.5, 0.5, (2, count, count))
    jitter /= SAMPLES * scale
    image = np.empty((count, count, 3), np.float32)
    image[:] = ROOM
    for shape in shapes_of(frame):
        grown = shape.radius + shape.line * unit + 1 / (SAMPLES * scale)
        low, high = shape.points.min(0) - grown, shape.points.max(0) + grown
        columns = slice(*np.searchsorted(axis, (low[0], high[0])))
        rows = slice(*np.searchsorted(axis, (-high[1], -low[1])))
        x, y = np.meshgrid(axis[columns], -axis[rows]) + jitter[:, rows, columns]
        edge, disc = inside(shape, x, y, unit)
        if shape.fill is not None:
            image[rows, columns][disc] = shape.fill
        image[rows, columns][edge] = shape.colour
    blocks = image.reshape(form.size, SAMPLES, form.size, SAMPLES, 3)
    return blocks.mean((1, 3))


def frame_of(world):
    state = world.state.map(lambda x: x[0])
    memory = {name: value[0] for name, value in world.memory.items()}
    eliminated = world.scenario.eliminated(memory)
    return Frame(
        world.scene,
        # The stripe of a puck is not part of an observation.
        state,
        world.scenario.shown_marks(state, memory),
        eliminated=() if eliminated is None else eliminated.tolist(),
    )


@pytest.fixture
def stripeless(monkeypatch):
    """Draw videos like observations: no stripe, and marks of a pixel or more."""
    from marl_airhockey.sim.render import picture

    thin = USUAL_WIDTH / image_form(SMALL).size

    def visible(mark, scene):
        return [
            [replace(s, line=max(s.line, thin) if s.line else 0.0) for s in part]
            for part in mark_shapes(mark, scene)
        ]

    monkeypatch.setattr(picture, "mark_shapes", visible)

    def nothing(centre, angle, radius):
        return picture.Shape(np.array([[9, 9], [9, 9.1]]), (0, 0, 0))

    monkeypatch.setattr(picture, "_stripe", nothing)


def check(world, image):
    """The image has the look of a video, except where the edges of bodies meet."""
    difference = np.abs(image - reference(frame_of(world), image_form(SMALL)))
    assert difference.mean() < 0.35
    assert np.quantile(difference, 0.98) < 3.3
    assert difference.max() < 45.0


def test_images_look_like_videos(scenario, stripeless):
    no_delay = (
        {"reaction": 0.0} if hasattr(ah.make_scenario(scenario), "reaction") else {}
    )
    world = ah.make_world(scenario, observe=SMALL, options=no_delay)
    check(world, world.reset(3)[0, 0])


@pytest.mark.parametrize(
    "keywords", [SQUARES, {"options": REGIONS}], ids=["squares", "regions"]
)
def test_squares_and_regions_look_like_videos(keywords, stripeless):
    world = ah.make_world("move_block", observe=SMALL, **keywords)
    world.reset(0)
    state = world.state
    state.angle[:] = 0.4
    check(world, world.set_state(state)[0, 0])


def test_the_goal_of_an_eliminated_seat_becomes_a_wall(stripeless):
    options = {"reaction": 0.0}
    world = ah.make_world("free_for_all", observe=SMALL, options=options)
    before = world.reset(0)
    state, memory = world.get_state()
    memory["lives"][:, 2] = 0.0
    after = world.set_state(state, memory)
    assert (before != after).sum() > 20
    check(world, after[0, 0])


@pytest.mark.parametrize(
    ("observe", "shape"),
    [
        ("pixels", (84, 84, 3)),
        ("pixels:frames=4,size=64", (64, 64, 4)),
        ("pixels:colour=rgb,frames=2", (84, 84, 6)),
    ],
)
def test_settings_give_size_colour_and_frames(observe, shape):
    env = ah.make_vec("hit_goal", 3, observe=observe)
    seen, _ = env.reset(seed=0)
    assert (seen.shape, seen.dtype) == ((3, *shape), np.uint8)
    for _ in range(4):
        later = env.step(np.ones((3, 2)))[0]
    assert env.observation_space.contains(later)
    channels = image_form(observe).channels
    oldest, newest = later[..., :channels], later[..., -channels:]
    assert not np.array_equal(oldest, newest)


def test_grey_is_the_luminance_of_the_colours():
    colour, grey = (
        ah.make_world("duel", observe=f"pixels:frames=1,colour={name}").reset(1)
        for name in ("rgb", "grey")
    )
    luminance = (colour * [0.299, 0.587, 0.114]).sum(-1, keepdims=True)
    assert np.abs(luminance - grey).max() <= 2.0


def test_each_seat_sees_the_same_table_from_its_side():
    world = ah.make_world("duel", observe=SMALL, options={"reaction": 0.0})
    world.reset(0)
    state = world.state
    state.position[:, 0] = [-0.5, 0.1]
    state.position[:, 1] = [0.5, -0.1]
    state.position[:, 2] = 0.0
    first, second = world.set_state(state)[0].astype(int)
    assert np.abs(first - second).max() <= 2


def test_teammates_see_their_goal_in_their_own_colour():
    world = ah.make_world("doubles", observe=SMALL, options={"reaction": 0.0})
    world.reset(0)
    state = world.state
    first = world.observe(np.array([0]))[0, 0].astype(int)
    state.position[:, [0, 1]] = state.position[:, [1, 0]]
    world.set_state(state)
    second = world.observe(np.array([1]))[0, 0].astype(int)
    # The pale outlines of the workspaces cover each other in another order.
    assert np.abs(first - second).max() <= 8


def test_images_and_goals_as_dictionaries_exclude_each_other():
    with pytest.raises(ValueError, match="images show the goal; omit goals="):
        ah.make_world("reach", observe="pixels", goals="dict")


def test_some_worlds_and_seats_have_their_rows():
    world = ah.make_world("doubles", 4, observe="pixels")
    every = world.reset(0)
    known = world.known
    rows, seats = np.array([3, 1]), np.array([2, 0])
    some = world.observer.read(known.sensed, known.memory, seats, "pixels", worlds=rows)
    np.testing.assert_array_equal(some, every[rows][:, seats])


def test_bodies_without_a_position_are_not_drawn():
    world = ah.make_world("strike", observe=SMALL)
    world.reset(0)
    images = world.observer.images[SMALL]
    frames = np.full((1, 1, 2, 3), np.nan)
    none = np.zeros((1, 0))
    nothing = Moving(frames, np.zeros((1, 0, 4, 2)), none, none)
    empty = images.draw(nothing, np.array([0]))
    far = replace_frames(nothing, frames.copy())
    far.frames[:] = 1e12
    np.testing.assert_array_equal(empty, images.draw(far, np.array([0])))
    assert len(np.unique(empty)) < 60


def replace_frames(moving, frames):
    return moving._replace(frames=frames)


@pytest.mark.parametrize(
    ("observe", "message"),
    [
        ("pixels:zoom=2", "unknown setting 'zoom'"),
        ("pixels:size=big", "size must be a whole number"),
        ("pixels:size=35", r"size: 35 is not one of 36 \.\. 256"),
        ("pixels:size=-5", r"size: -5 is not one of 36 \.\. 256"),
        ("pixels:frames=3,frames=2", "frames is given twice"),
        ("pixels:frames=0", r"frames: 0 is not one of 1 \.\. 8"),
        ("pixels:colour=red", "unknown colour 'red'"),
        ("pixel", "unknown observe 'pixel'"),
    ],
)
def test_wrong_settings_are_named(observe, message):
    with pytest.raises(ValueError, match=message):
        ah.make_world("juggle", observe=observe)


def test_images_that_need_too_much_memory_are_named(monkeypatch):
    monkeypatch.setattr("os.sysconf", lambda name: 1000)
    with pytest.raises(ValueError, match="use fewer worlds, smaller images"):
        ah.make_world("juggle", 64, observe="pixels")
    assert replace(ImageForm(), size=64).shape == (64, 64, 3)
