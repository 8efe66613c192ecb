"""Cameras: the newest frame alone, with the time at which it was taken."""

import fcntl
import socket
import threading
import time

import cv2
import numpy as np
import pytest

from marl_airhockey.hardware.camera import (
    Camera,
    CameraError,
    CameraFrame,
    FileSource,
    StreamSource,
    SyntheticSource,
    open_source,
    v4l2,
)
from marl_airhockey.hardware.camera.sources import pack_frame

GREY = np.full((6, 8, 3), 100, np.uint8)


def test_who_looks_late_sees_the_newest_frame():
    with Camera(SyntheticSource(lambda now: GREY, rate=200.0)) as camera:
        first = camera.next()
        time.sleep(0.1)
        second = camera.next(first.number)
    assert second.number > first.number + 1
    assert camera.dropped >= second.number - first.number - 2
    assert second.taken > first.taken


def test_a_camera_that_is_silent_says_so():
    stop = threading.Event()

    def draw(now):
        stop.wait(1.0)
        return GREY

    with Camera(SyntheticSource(draw)) as camera:
        assert camera.next(seconds=0.05) is None
        assert "no frame" in camera.trouble
        stop.set()


def test_a_stream_brings_frames_as_they_were():
    with socket.create_server(("127.0.0.1", 0)) as server:
        image = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)

        def send():
            client, _ = server.accept()
            with client:
                client.sendall(pack_frame(CameraFrame(image, 12.5, 7)))

        threading.Thread(target=send).start()
        with Camera(StreamSource(server.getsockname()[1])) as camera:
            frame = camera.next()
    assert (frame.taken, frame.number) == (12.5, 7)
    np.testing.assert_array_equal(frame.image, image)


def test_a_stream_of_something_else_is_named():
    with socket.create_server(("127.0.0.1", 0)) as server:

        def send():
            client, _ = server.accept()
            with client:
                client.sendall(b"HTTP/1.1 200 OK" + b" " * 100)

        threading.Thread(target=send).start()
        with Camera(StreamSource(server.getsockname()[1])) as camera:
            assert camera.next(seconds=0.5) is None
            assert "expected frames" in camera.trouble


def test_a_video_is_played_to_its_end(tmp_path):
    path = tmp_path / "table.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (64, 48))
    for k in range(5):
        writer.write(np.full((48, 64, 3), 40 * k, np.uint8))
    writer.release()
    source = FileSource(path, realtime=False)
    source.open()
    frames = [source.read() for _ in range(6)]
    source.close()
    assert frames[-1] is None
    means = [frame.image.mean() for frame in frames[:5]]
    assert means == sorted(means)


@pytest.mark.parametrize(
    "text",
    [
        *("v4l2:x", "stream:", "webcam", "nothing.mp4", "stream:5,gain=1"),
        *("v4l2:0,gian=20", "v4l2:0,gain=much", "v4l2:0,width=0", "v4l2:0,exposure"),
    ],
)
def test_a_source_that_is_none_is_named(text):
    with pytest.raises(ValueError, match="camera"):
        open_source(text)


def test_a_camera_that_is_not_there_is_named():
    with pytest.raises(CameraError, match="no stream"):
        StreamSource(1).open()
    with pytest.raises(CameraError, match="no video"):
        FileSource("nothing.mp4").open()
    with pytest.raises(CameraError, match=r"there is no /dev/video987; there are"):
        open_source("v4l2:987,exposure=60").open()


class Capture:
    """Capture device of OpenCV that gives 640 x 480 pictures, whatever is asked for."""

    rate = 60.0
    stamps = iter(())
    """Time stamps of the driver, s"""

    def __init__(self, *_):
        self.asked = {}

    def read(self):
        self.stamp = next(self.stamps, 0.0)
        return True, GREY

    def isOpened(self):
        return True

    def set(self, name, value):
        self.asked[name] = value

    def get(self, name):
        return {
            cv2.CAP_PROP_FRAME_WIDTH: 640,
            cv2.CAP_PROP_FRAME_HEIGHT: 480,
            cv2.CAP_PROP_FPS: self.rate,
            cv2.CAP_PROP_POS_MSEC: 1e3 * getattr(self, "stamp", 0.0),
        }[name]

    def release(self):
        pass


@pytest.fixture
def controls(monkeypatch, tmp_path):
    """Values that controls were set to; the camera has no control of white balance.

    The control "stuck" keeps its value, whatever it is set to.
    """
    found = {}

    def ioctl(descriptor, request, packed):
        control, value = v4l2.CONTROL.unpack(packed)
        if control == v4l2.CONTROLS["white_balance"][0]:
            raise OSError(22, "Invalid argument")
        if request == v4l2.SET_CONTROL and control != found.get("stuck"):
            found[control] = value
        return v4l2.CONTROL.pack(control, found.get(control, 3))

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    monkeypatch.setattr(v4l2.cv2, "VideoCapture", Capture)
    device = tmp_path / "video0"
    device.touch()
    monkeypatch.setattr(v4l2, "Path", lambda text: device)
    return found


def test_a_camera_keeps_to_what_it_was_set_to(controls):
    open_source("v4l2:0,exposure=60,gain=20").open()
    for control, off in v4l2.AUTOMATIC.values():
        assert controls[control] == off
    assert controls[v4l2.CONTROLS["exposure"][0]] == 60
    assert controls[v4l2.CONTROLS["gain"][0]] == 20


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ("width=1280", "640 x 480, not of 1280 x 480"),
        ("white_balance=4000", "refuses white_balance=4000"),
    ],
)
def test_what_a_camera_cannot_do_is_named(controls, settings, reason):
    with pytest.raises(CameraError, match=reason):
        open_source(f"v4l2:0,{settings}").open()


@pytest.mark.parametrize("name", v4l2.AUTOMATIC)
def test_an_automatic_control_that_stays_on_is_named(controls, name):
    controls["stuck"], _ = v4l2.AUTOMATIC[name]
    with pytest.raises(CameraError, match=f"automatic {name} stays on"):
        open_source("v4l2:0").open()


def test_a_setting_that_the_camera_does_not_keep_is_named(controls):
    controls["stuck"] = v4l2.CONTROLS["gain"][0]
    with pytest.raises(CameraError, match="refuses gain=20"):
        open_source("v4l2:0,gain=20").open()


def test_a_rate_that_the_camera_does_not_have_is_named(controls, monkeypatch):
    monkeypatch.setattr(Capture, "rate", 30.0)
    with pytest.raises(CameraError, match=r"30 frames per second, not 60; .*rate=30"):
        open_source("v4l2:0").open()
    open_source("v4l2:0,rate=30").open()


def test_frames_carry_the_driver_s_time_stamps(controls, monkeypatch):
    """A reader that is served late does not make frames later."""
    began = time.monotonic()
    stamps = began + np.arange(8) / 60.0
    monkeypatch.setattr(Capture, "stamps", iter(stamps))
    source = open_source("v4l2:0", latency=0.02)
    source.open()
    taken = []
    for k, stamp in enumerate(stamps):
        late = 0.003 + 0.05 * (k == 4)
        time.sleep(max(stamp + late - time.monotonic(), 0.0))
        taken.append(source.read().taken)
    off = np.array(taken) - stamps
    assert np.ptp(off[1:]) < 0.004
    assert off[-1] == pytest.approx(0.003 - 0.02, abs=0.003)


def test_time_stamps_of_another_clock_are_not_used(controls, monkeypatch):
    monkeypatch.setattr(Capture, "stamps", iter([1.7e9, 0.0, -5.0]))
    source = open_source("v4l2:0", latency=0.02)
    source.open()
    for _ in range(3):
        assert source.read().taken == pytest.approx(time.monotonic() - 0.02, abs=0.01)
