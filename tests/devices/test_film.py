"""Films: every picture with the time at which it was taken, or word of what is not."""

import time

import cv2
import numpy as np
import pytest

from marl_airhockey.devices.camera import Camera, Film, SyntheticSource, film
from marl_airhockey.devices.camera.film import read_times

GREY = np.full((48, 64, 3), 100, np.uint8)


def film_for(seconds, path):
    """Film a synthetic camera; return what the film says is missing."""
    with Camera(SyntheticSource(lambda now: GREY, rate=50.0)) as camera:
        reel = Film(camera, path)
        time.sleep(seconds)
        reel.close()
    return reel.trouble


def test_a_film_has_a_time_for_each_picture(tmp_path):
    path = tmp_path / "a.mkv"
    assert film_for(0.5, path) == ""
    times = read_times(path)
    video = cv2.VideoCapture(str(path))
    count = 0
    while video.read()[0]:
        count += 1
    assert count == len(times) > 5
    assert (np.diff(times) > 0).all()


def test_a_film_of_few_frames_is_written(tmp_path):
    path = tmp_path / "a.mkv"
    with Camera(SyntheticSource(lambda now: GREY, rate=10.0)) as camera:
        reel = Film(camera, path)
        time.sleep(0.25)
        reel.close()
    assert reel.trouble == ""
    assert len(read_times(path)) in (1, 2, 3)
    assert cv2.VideoCapture(str(path)).read()[0]


def test_a_film_that_cannot_be_written_says_so(tmp_path):
    path = tmp_path / "a.mkv"
    path.mkdir()
    with pytest.warns(RuntimeWarning, match="no video can be written"):
        assert "no video" in film_for(0.5, path)


def test_pictures_that_came_too_fast_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(film, "MOST", 0)
    with pytest.warns(RuntimeWarning, match="pictures are missing"):
        film_for(0.2, tmp_path / "a.mkv")
