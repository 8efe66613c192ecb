"""Films: every picture with the time at which it was taken, or word of what is not."""

import re
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest
from disks import largest_file

from marl_airhockey.hardware.camera import (
    Camera,
    CameraFrame,
    FileSource,
    Film,
    SyntheticSource,
    film,
)
from marl_airhockey.hardware.camera.film import read_times

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
    with pytest.warns(RuntimeWarning, match="ends after 0 frames: Is a directory"):
        film_for(0.3, path)


def pictures_in(path):
    """Return the times of the pictures in a video, s, since the first."""
    source = FileSource(path, realtime=False)
    source.open()
    times = []
    while (frame := source.read()) is not None:
        times.append(frame.taken)
    source.close()
    return np.array(times)


def noisy(now):
    rng = np.random.default_rng(round(1e6 * now))
    return rng.integers(0, 255, (48, 64, 3)).astype(np.uint8)


def test_a_full_disk_ends_the_film_with_a_reason_and_keeps_what_is_there(tmp_path):
    path = tmp_path / "a.mkv"
    with Camera(SyntheticSource(noisy, rate=100.0)) as camera:
        reel = Film(camera, path)
        time.sleep(0.2)
        assert reel.trouble == ""
        with largest_file(path.stat().st_size + 2000):
            time.sleep(0.4)
            assert "frames: File too large" in reel.trouble
        time.sleep(0.2)
        with pytest.warns(RuntimeWarning, match="File too large"):
            reel.close()
    count = int(re.search(r"ends after (\d+) frames", reel.trouble)[1])
    assert count > 5
    assert len(read_times(path)) == count
    # The last picture may be cut; none vanishes without a word.
    assert count <= len(pictures_in(path)) <= count + 1


def test_a_killed_film_has_all_pictures_of_its_times(tmp_path):
    path = tmp_path / "a.mkv"
    code = (
        "import sys, time, numpy as np\n"
        "from marl_airhockey.hardware.camera import Camera, Film, SyntheticSource\n"
        "from pathlib import Path\n"
        "draw = lambda now: np.full((48, 64, 3), int(50 * now) % 255, np.uint8)\n"
        "with Camera(SyntheticSource(draw, rate=50.0)) as camera:\n"
        "    Film(camera, Path(sys.argv[1]))\n"
        "    time.sleep(0.5); print('ready', flush=True); time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, path], stdout=subprocess.PIPE
    ) as child:
        child.stdout.readline()
        child.kill()
    assert len(read_times(path)) > 10
    assert abs(len(pictures_in(path)) - len(read_times(path))) <= 1


def test_a_video_of_a_variable_rate_keeps_its_own_times(tmp_path):
    """A camera that pauses: a mean rate would be off by most of a second."""
    pauses = iter([0.02] * 10 + [0.6] + [0.01] * 20 + [0.05] * 5)

    class Pausing(SyntheticSource):
        def read(self):
            time.sleep(next(pauses, 0.02))
            return CameraFrame(GREY, time.monotonic(), self._next())

        def _next(self):
            self._count += 1
            return self._count

    path = tmp_path / "a.mkv"
    with Camera(Pausing(lambda now: GREY)) as camera:
        reel = Film(camera, path)
        time.sleep(1.4)
        reel.close()
    times = read_times(path)
    np.testing.assert_allclose(pictures_in(path), times - times[0], atol=2e-3)
    assert np.diff(times).max() > 0.5


def test_pictures_that_came_too_fast_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(film, "MOST", 0)
    with pytest.warns(RuntimeWarning, match="frames are missing"):
        film_for(0.2, tmp_path / "a.mkv")
