import time

import cv2
import numpy as np
import pytest

from marl_airhockey.play.live_match import LiveMatch

pytest.importorskip("robosuite")

from marl_airhockey.play.scene_view import SceneView


@pytest.fixture(scope="module")
def match():
    match = LiveMatch("juggle", {"paddle_0": "allround"}, {"backend": "robosuite"})
    match.warm_up()
    yield match
    match.close()


@pytest.fixture
def view(match):
    view = SceneView(match)
    yield view
    view.close()


def next_image(view, match, after, seconds=30.0):
    """Offer the state of a match until there is an image; None if there is none"""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        view.offer(match)
        found = view.newest(after)
        if "OpenGL" in view.failure:
            pytest.skip(view.failure)
        if found or view.failure:
            return found
    return None


def test_view_renders_when_the_match_moves(match, view):
    first, packed = next_image(view, match, -1)
    image = cv2.imdecode(np.frombuffer(packed, np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (400, 640, 3)
    assert image.std() > 20
    assert next_image(view, match, first, 1.0) is None
    match.start()
    match.time_left = 0.0
    for _ in range(30):
        match.tick()
    _, packed = next_image(view, match, first)
    moved = cv2.imdecode(np.frombuffer(packed, np.uint8), cv2.IMREAD_COLOR)
    assert (cv2.absdiff(image, moved).max(-1) > 40).sum() > 200


def test_view_reports_a_dead_process_and_the_match_continues(match, view):
    number, _ = next_image(view, match, -1)
    view.process.kill()
    assert next_image(view, match, number) is None
    assert view.failure == "3D scene: its process has ended"
    assert view.newest(-1) is None
    match.start()
    match.time_left = 0.0
    assert match.tick()
    view.offer(match)


@pytest.mark.slow
def test_view_renders_nothing_while_no_page_watches(match, view):
    number, _ = next_image(view, match, -1)
    time.sleep(1.1)
    match.tick()
    for _ in range(30):
        view.offer(match)
        time.sleep(0.01)
    assert view.newest(number) is None


def test_view_rejects_a_match_without_arms():
    match = LiveMatch("juggle", {}, {})
    assert not SceneView.shows(match)
    with pytest.raises(ValueError, match="needs the backend robosuite"):
        SceneView(match)
    match.close()
