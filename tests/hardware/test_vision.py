"""Vision on pictures of a table that is known: how exact, and what it refuses."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from marl_airhockey.hardware.camera import CameraFrame
from marl_airhockey.hardware.lab.table_camera import (
    Seen,
    TableCamera,
    lab_view,
    tag_places,
)
from marl_airhockey.hardware.vision import Colour, Detector
from marl_airhockey.hardware.vision.boards import lens_from_boards, make_board
from marl_airhockey.hardware.vision.calibration import (
    find_tags,
    moved,
    tag_corners,
    view_from_clicks,
    view_from_tags,
    view_from_tags_and_edges,
    view_trouble,
)
from marl_airhockey.hardware.vision.mark import NOISE
from marl_airhockey.sim.core.table import TABLES

TABLE = TABLES["full_size"]
VIEW = lab_view(TABLE)
KNOWN = {k: tag_corners(place) for k, place in tag_places(TABLE).items()}
STILL = np.zeros(2)
HOME = np.array([-0.65, 0.0])


@pytest.fixture(scope="module")
def camera():
    return TableCamera(TABLE, VIEW, np.array([-1.185, 0.0]), seed=3)


@pytest.fixture(scope="module")
def detector(camera):
    image = camera.photograph(Seen(np.array([0.3, 0.0]), STILL, HOME, STILL))
    x, y = VIEW.project(np.array([[0.3, 0.0, 0.003]]))[0]
    half = tuple(TABLE.size / 2)
    return Detector(VIEW, Colour.around(image, (x, y)), TABLE.puck_radius, half)


def grid():
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 9), np.linspace(-0.4, 0.4, 5))
    return np.stack([x.ravel(), y.ravel()], 1)


def test_pixels_and_places_are_each_others_inverse():
    for height in (0.0, 0.06):
        points = np.column_stack([grid(), np.full(45, height)])
        back = VIEW.to_table(VIEW.project(points), height)
        np.testing.assert_allclose(back, grid(), atol=2e-5)


def test_a_flying_puck_is_found_to_half_a_millimetre(camera, detector):
    rng, errors, speeds = np.random.default_rng(0), [], rng_speeds(60)
    for k, velocity in enumerate(speeds):
        place = rng.uniform([-0.3, -0.38], [0.92, 0.38])
        image = camera.photograph(Seen(place, velocity, HOME, STILL), k)
        seen = detector.find(CameraFrame(image, 1.0, k))
        assert seen is not None
        errors.append(np.linalg.norm(seen.place - place))
    assert np.mean(errors) < 0.0006
    assert np.max(errors) < 0.002


def rng_speeds(count):
    return np.random.default_rng(1).normal(0.0, 1.0, (count, 2))


def test_a_puck_half_under_the_arm_is_completed(camera, detector):
    # Beside the paddle the arm hides a part of it.
    errors = []
    for y in np.linspace(0.055, 0.085, 7):
        place = HOME + np.array([-0.12, y])
        image = camera.photograph(Seen(place, STILL, HOME, STILL))
        seen = detector.find(CameraFrame(image, 0.0, 0))
        if seen is not None and seen.share < 0.93:
            errors.append(np.linalg.norm(seen.place - place))
    assert errors
    assert np.max(errors) < 0.005


@pytest.fixture(scope="module")
def marked_camera():
    return TableCamera(TABLE, VIEW, np.array([-1.185, 0.0]), seed=3, marked=True)


def turned(off):
    """Difference of two orientations of a bar, rad."""
    return off - np.pi * np.round(np.asarray(off) / np.pi)


@pytest.mark.parametrize("speed", [0.0, 1.0, 2.0])
def test_the_orientation_of_a_marked_puck_is_read(marked_camera, detector, speed):
    rng, off, errors = np.random.default_rng(0), [], []
    finder = replace(detector, marked=True)
    for k in range(80):
        place = rng.uniform([-0.3, -0.38], [0.92, 0.38])
        heading, angle = rng.uniform(-np.pi, np.pi, 2)
        velocity = speed * np.array([np.cos(heading), np.sin(heading)])
        turn = angle, rng.normal(0.0, 15.0)
        image = marked_camera.photograph(Seen(place, velocity, HOME, STILL, *turn), k)
        seen = finder.find(CameraFrame(image, 1.0, k))
        off.append(turned(seen.angle - angle))
        errors.append(np.linalg.norm(seen.place - place))
    assert np.sqrt(np.mean(np.square(off))) < 1.3 * NOISE
    assert np.mean(errors) < 0.0006


def test_a_puck_without_a_mark_or_under_the_arm_has_no_orientation(
    camera, marked_camera, detector
):
    finder = replace(detector, marked=True)
    plain = camera.photograph(Seen(np.array([0.4, 0.1]), STILL, HOME, STILL))
    assert np.isnan(finder.find(CameraFrame(plain, 0.0, 0)).angle)
    hidden = 0
    for y in np.linspace(0.04, 0.085, 9):
        place = HOME + np.array([-0.12, y])
        image = marked_camera.photograph(Seen(place, STILL, HOME, STILL, 0.5))
        seen = finder.find(CameraFrame(image, 0.0, 0))
        if seen is not None and seen.share < 0.85:
            hidden += 1
            assert np.isnan(seen.angle)
    assert hidden


def test_the_colour_of_a_marked_puck_is_that_around_the_mark(marked_camera):
    place = np.array([0.3, 0.0])
    image = marked_camera.photograph(Seen(place, STILL, HOME, STILL, 0.7))
    x, y = VIEW.project(np.array([[*place, 0.003]]))[0]
    colour = Colour.around(image, (x, y))
    half = tuple(TABLE.size / 2)
    finder = Detector(VIEW, colour, TABLE.puck_radius, half, marked=True)
    seen = finder.find(CameraFrame(image, 0.0, 0))
    assert np.linalg.norm(seen.place - place) < 0.001
    assert abs(turned(seen.angle - 0.7)) < 0.1


def test_no_puck_is_no_puck(camera, detector):
    image = camera.photograph(Seen(None, STILL, HOME, STILL))
    assert detector.find(CameraFrame(image, 0.0, 0)) is None
    under = camera.photograph(Seen(HOME - np.array([0.1, 0.0]), STILL, HOME, STILL))
    assert detector.find(CameraFrame(under, 0.0, 0)) is None


def test_a_rolling_shutter_dates_each_row():
    lines = Detector(VIEW, Colour(0.0), 0.03, (1.0, 0.5), readout=0.01)
    image = np.zeros((480, 640, 3), np.uint8)
    times = [
        lines._time(CameraFrame(image, 5.0, 0), np.array([0.0, y])) for y in (0, 480)
    ]
    np.testing.assert_allclose(times, [4.995, 5.005])


def test_tags_find_the_camera_better_than_clicks(camera):
    image = camera.photograph(Seen(None, STILL, HOME, STILL))
    seen = find_tags(image)
    assert set(seen) == set(KNOWN)
    view = view_from_tags(seen, KNOWN, VIEW.lens)
    flat = np.column_stack([grid(), np.zeros(45)])
    by_tags = np.linalg.norm(view.to_table(VIEW.project(flat)) - grid(), axis=1)
    assert by_tags.mean() < 0.0006
    corners = np.asarray(TABLE.vertices)
    pixels = VIEW.project(np.column_stack([corners, np.zeros(4)]))
    clicked = pixels + np.random.default_rng(2).normal(0.0, 1.5, (4, 2))
    by_clicks = view_from_clicks(clicked, corners, VIEW.lens)
    off = np.linalg.norm(by_clicks.to_table(VIEW.project(flat)) - grid(), axis=1)
    assert by_tags.mean() < off.mean() < 0.02
    assert moved(view, seen, KNOWN) < 1.0


def measured_tags(rng, error):
    return {k: four + rng.normal(0.0, error, 2) for k, four in KNOWN.items()}


def test_edges_correct_tags_that_were_measured_badly(camera):
    image, corners = camera.photograph(Seen(None, STILL, HOME, STILL)), TABLE.vertices
    seen, flat = find_tags(image), np.column_stack([grid(), np.zeros(45)])
    rng, off = np.random.default_rng(0), []
    for _ in range(5):
        known = measured_tags(rng, 0.001)
        both = seen, known, image, np.asarray(corners), VIEW.lens
        views = view_from_tags(seen, known, VIEW.lens), view_from_tags_and_edges(*both)
        places = [view.to_table(VIEW.project(flat)) for view in views]
        off.append([np.linalg.norm(each - grid(), axis=1).mean() for each in places])
    tags, edges = np.mean(off, axis=0)
    assert edges < 0.0004 < tags


def test_tags_that_do_not_fit_the_edges_are_named(camera):
    image, lens = camera.photograph(Seen(None, STILL, HOME, STILL)), VIEW.lens
    seen, corners = find_tags(image), np.asarray(TABLE.vertices)
    wrong = {**KNOWN, 3: KNOWN[3] + np.array([0.0, 0.009])}
    with pytest.raises(ValueError, match=r"tag 3 is [78] mm from its measured"):
        view_from_tags_and_edges(seen, wrong, image, corners, lens)
    # The field of another table.
    with pytest.raises(ValueError, match=r"not seen|from its measured|fit to"):
        view_from_tags_and_edges(seen, KNOWN, image, 0.95 * corners, lens)


def test_what_cannot_be_a_calibration_is_refused(camera):
    seen = find_tags(camera.photograph(Seen(None, STILL, HOME, STILL)))
    few = {k: seen[k] for k in (0, 1)}
    with pytest.raises(ValueError, match="2 of 8 tags"):
        view_from_tags(few, KNOWN, VIEW.lens)
    swapped = {**seen, 0: seen[5], 5: seen[0]}
    with pytest.raises(ValueError, match="fit to"):
        view_from_tags(swapped, KNOWN, VIEW.lens)
    with pytest.raises(ValueError, match="at least four"):
        view_from_clicks(np.zeros((3, 2)), np.zeros((3, 2)), VIEW.lens)


def test_red_lies_at_both_ends_of_the_hues():
    image = np.zeros((20, 40, 3), np.uint8)
    image[:, :20], image[:, 20:] = (20, 0, 220), (0, 20, 220)
    for hue in (1.0, 179.0):
        assert Colour(hue).mask(image).all()
    assert not Colour(60.0).mask(image).any()


def test_a_click_beside_the_puck_is_named(camera):
    image = camera.photograph(Seen(None, STILL, HOME, STILL))
    x, y = VIEW.project(np.array([[0.3, 0.0, 0.0]]))[0]
    with pytest.raises(ValueError, match="no colour"):
        Colour.around(image, (x, y))
    with pytest.raises(ValueError, match="outside"):
        Colour.around(image, (9000.0, 10.0))


def test_a_picture_of_something_else_is_named(camera):
    image = camera.photograph(Seen(None, STILL, HOME, STILL))
    assert view_trouble(VIEW, [image], KNOWN) == ""
    small = image[::2, ::2]
    assert "320 x 240, those of the calibrated camera" in view_trouble(
        VIEW, [small], KNOWN
    )
    assert "none of the table's tags" in view_trouble(VIEW, [image * 0 + 120], KNOWN)
    assert "dark (mean 3 of 255)" in view_trouble(VIEW, [image * 0 + 3], KNOWN)
    shifted = np.roll(image, 6, axis=1)
    assert "from where they were" in view_trouble(VIEW, [shifted], KNOWN)


def test_a_second_puck_is_seen(camera, detector):
    puck = np.array([0.2, 0.1])
    camera.left = np.array([0.55, -0.25])
    seen = Seen(puck, STILL, HOME, STILL)
    found = detector.find_all(CameraFrame(camera.photograph(seen), 0.0, 0))
    camera.left = None
    places = sorted(seen.place.tolist() for seen in found)
    np.testing.assert_allclose(places, [[0.2, 0.1], [0.55, -0.25]], atol=0.003)


def board_views(tilt, spread, far=(0.4, 0.8), count=12):
    """Return corners and their numbers of a board in some poses before a camera.

    Args:
        tilt: Largest tilt, deg.
        spread: Part of the picture over which the boards are spread.
        far: Least and largest distance, m.
        count: Number of pictures.
    """
    rng, lens = np.random.default_rng(0), VIEW.lens
    corners = np.asarray(make_board().getChessboardCorners(), float)
    middle, views = corners.mean(0), []
    while len(views) < count:
        angle, turn = (
            rng.uniform(0.0, 2 * np.pi),
            np.radians(rng.uniform(0.7, 1) * tilt),
        )
        lean = np.array([np.cos(angle), np.sin(angle), 0.0]) * turn
        z = rng.uniform(*far)
        aside = spread * z * rng.uniform(-1, 1, 2) * (0.45, 0.33)
        pixels, _ = cv2.projectPoints(
            (corners - middle), lean, np.array([*aside, z]), *lens.arrays
        )
        pixels = pixels.reshape(-1, 2)
        inside = ((pixels > 2) & (pixels < np.array(lens.size) - 2)).all(1)
        if inside.sum() >= 12:
            noisy = pixels[inside] + rng.normal(0.0, 0.15, (inside.sum(), 2))
            views.append((noisy, np.flatnonzero(inside)))
    return views


def test_tilted_boards_in_all_parts_of_the_picture_determine_the_lens():
    lens = lens_from_boards(board_views(35.0, 1.0), VIEW.lens.size)
    focal = VIEW.lens.matrix[0][0]
    assert lens.matrix[0][0] == pytest.approx(focal, rel=0.02)


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ({"tilt": 2.0, "spread": 1.0}, "tilted by at most . deg"),
        ({"tilt": 10.0, "spread": 1.0}, "tilted by at most 10 deg"),
        ({"tilt": 35.0, "spread": 0.1}, "of the image's width"),
        ({"tilt": 17.0, "spread": 1.0, "far": (1.4, 1.6), "count": 8}, "uncertain by"),
    ],
)
def test_boards_that_determine_no_lens_are_refused(poses, words):
    with pytest.raises(ValueError, match=words):
        lens_from_boards(board_views(**poses), VIEW.lens.size)


@pytest.mark.parametrize("shift", [(0.003, 0.0), (0.0, -0.003), (0.0022, 0.0022)])
def test_a_camera_that_moved_by_three_millimetres_is_noticed(shift):
    known = {k: tag_corners(place) for k, place in tag_places(TABLE).items()}

    def picture(view):
        camera = TableCamera(TABLE, view, np.array([-1.2, 0.0]), seed=4)
        return camera.photograph(Seen(None, np.zeros(2), np.zeros(2), np.zeros(2)), 1)

    assert view_trouble(VIEW, [picture(VIEW)], known) == ""
    x, y, z = VIEW.translation
    moved = replace(VIEW, translation=(x + shift[0], y + shift[1], z))
    words = view_trouble(VIEW, [picture(moved)], known)
    assert "mm from where they were on the table" in words
