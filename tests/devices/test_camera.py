"""Cameras: the newest frame alone, with the time at which it was taken."""

import socket
import threading
import time

import cv2
import numpy as np
import pytest

from marl_airhockey.devices.camera import (
    Camera,
    CameraError,
    FileSource,
    Frame,
    StreamSource,
    SyntheticSource,
    open_source,
    v4l2,
)
from marl_airhockey.devices.camera.sources import pack_frame

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
                client.sendall(pack_frame(Frame(image, 12.5, 7)))

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

    def __init__(self, *_):
        self.asked = {}

    def isOpened(self):
        return True

    def set(self, name, value):
        self.asked[name] = value

    def get(self, name):
        return {cv2.CAP_PROP_FRAME_WIDTH: 640, cv2.CAP_PROP_FRAME_HEIGHT: 480}[name]

    def release(self):
        pass


@pytest.fixture
def controls(monkeypatch, tmp_path):
    """Values that controls were set to; the camera has no control of white balance."""
    found = {}

    def ioctl(descriptor, request, packed):
        control, value = v4l2.CONTROL.unpack(packed)
        if control == v4l2.CONTROLS["white_balance"][0]:
            raise OSError(22, "Invalid argument")
        found[control] = value

    monkeypatch.setattr(v4l2.fcntl, "ioctl", ioctl)
    monkeypatch.setattr(v4l2.cv2, "VideoCapture", Capture)
    device = tmp_path / "video0"
    device.touch()
    monkeypatch.setattr(v4l2, "Path", lambda text: device)
    return found


def test_a_camera_keeps_to_what_it_was_set_to(controls):
    open_source("v4l2:0,exposure=60,gain=20").open()
    assert {control: controls[control] for control in v4l2.AUTOMATIC} == v4l2.AUTOMATIC
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
