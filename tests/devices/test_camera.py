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
            assert "something else" in camera.trouble


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


@pytest.mark.parametrize("text", ["v4l2:x", "stream:", "webcam", "nothing.mp4"])
def test_a_source_that_is_none_is_named(text):
    with pytest.raises(ValueError, match="camera"):
        open_source(text)


def test_a_camera_that_is_not_there_is_named():
    with pytest.raises(CameraError, match="no stream"):
        StreamSource(1).open()
    with pytest.raises(CameraError, match="no video"):
        FileSource("nothing.mp4").open()
