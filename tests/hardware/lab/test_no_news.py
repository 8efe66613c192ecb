"""Pictures that are not news, and pucks that are not where they must be."""

import time

import numpy as np
import pytest

from marl_airhockey.hardware.camera import Camera, SyntheticSource
from marl_airhockey.hardware.table.innovations import SKIPPED, Innovations
from marl_airhockey.hardware.vision.watcher import Watcher


class NoDisc:
    """Detector that finds nothing."""

    def __init__(self):
        self.searched = 0

    def find(self, frame):
        self.searched += 1
        return None


def trouble_of(draw, seconds=0.9, rate=60.0):
    """Return what a watcher says of the pictures of a function, and how many count."""
    detector = NoDisc()
    with Camera(SyntheticSource(draw, rate)) as camera:
        watcher = Watcher(camera, detector)
        time.sleep(seconds)
        found = watcher.trouble
        watcher.close()
    return found, detector.searched / max(watcher.pictures, 1)


def noise(k):
    return np.random.default_rng(k).integers(0, 255, (8, 8, 3)).astype(np.uint8)


@pytest.mark.parametrize(
    ("every", "words", "share"),
    [(1, "", 1.0), (2, "10 of 20 frames repeat", 0.5), (10**6, "same frame", 0.1)],
)
def test_repeated_pictures_are_noticed_and_not_searched(every, words, share):
    count = iter(range(10**6))
    found, searched = trouble_of(lambda now: noise(next(count) // every))
    assert words in found
    assert bool(found) == bool(words)
    assert searched == pytest.approx(share, abs=0.12)


def test_a_few_repeats_are_no_trouble():
    count = iter(range(10**6))
    found, _ = trouble_of(lambda now: noise(next(count) * 9 // 10))
    assert found == ""


FRAME = 1 / 30
"""Time between two sightings, s"""


def innovations(sizes):
    """Return the innovations of some sizes, mm."""
    made = Innovations()
    for size in [1.0] * SKIPPED + list(sizes):
        made.add(np.array([1e-3 * size, 0.0]), FRAME)
    return made


def test_usual_innovations_and_single_jumps_are_no_trouble():
    rng = np.random.default_rng(0)
    usual = rng.rayleigh(0.7, 300)
    usual[::40] = 11.0
    assert innovations(usual).trouble == ""
    assert innovations([*usual, 250.0]).trouble == ""


@pytest.mark.parametrize("usual", [0.7, 3.0])
def test_jumps_that_stay_are_trouble_in_proportion_to_the_usual_size(usual):
    rng = np.random.default_rng(0)
    before = list(rng.rayleigh(usual, 400))
    assert innovations(before).trouble == ""
    after = [50.0 if k % 3 == 0 else usual for k in range(30)]
    assert "is there a second one" in innovations(before + after).trouble


SHOT_AWAY = [4.0, 43.0, 148.0, 111.0]
"""Innovations when a paddle squeezes the puck against a wall, mm"""


def test_one_hit_that_was_predicted_wrongly_is_no_trouble_and_two_are():
    sizes = [0.7] * 50 + SHOT_AWAY + [0.7] * 40
    for end in range(len(sizes)):
        assert innovations(sizes[:end]).trouble == ""
    assert "did the camera move" in innovations(sizes + SHOT_AWAY).trouble


def test_a_jump_to_a_second_puck_is_trouble():
    sizes = [0.7] * 50 + [600.0] + [0.7] * 15
    assert "is there a second one" in innovations(sizes).trouble


def test_a_puck_that_was_hidden_for_a_second_may_be_anywhere():
    made = innovations([0.7] * 50)
    made.add(np.array([0.6, 0.0]), 1.0)
    for _ in range(15):
        made.add(np.array([7e-4, 0.0]), FRAME)
        assert made.trouble == ""


def test_the_first_sightings_of_an_episode_do_not_count():
    made = Innovations()
    for _ in range(SKIPPED):
        made.add(np.array([0.5, 0.0]), FRAME)
    assert made.trouble == ""
    made.restart()
    made.add(np.array([0.5, 0.0]), FRAME)
    assert made.mean == made.usual
