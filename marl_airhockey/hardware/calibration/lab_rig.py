"""Calibration of the lab's rig, as at a real table.

It uses only values that could be measured at a real table, except for the lens.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import date
from pathlib import Path

import cv2
import numpy as np

from marl_airhockey.hardware.camera import Camera, CameraFrame, open_source
from marl_airhockey.hardware.hand_rig import HandRig
from marl_airhockey.hardware.lab.hand_camera import FIELD, hand_tag_places, hand_view
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served
from marl_airhockey.hardware.lab.table_camera import lab_view, tag_places
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot.mounting import fit_mounting
from marl_airhockey.hardware.vision import Colour
from marl_airhockey.hardware.vision.calibration import (
    find_tags,
    tag_corners,
    view_from_tags,
)
from marl_airhockey.sim.contracts.camera_model import PADDLE_TOP
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.jit.folders import cache_folder
from marl_airhockey.types import Array

PICTURES = 8
"""Number of frames over which the corners of tags are averaged."""
CLICKED = np.array([[0.3, 0.0, 0.003]])
"""Position (1, 3) of the puck while its colour is clicked, table frame, m."""
BLOCK = np.array([[0.3, 0.25, 0.003]])
"""The same for the block."""
RIM, DIRECTIONS = 0.034, 16
"""Distance of possible clicks from the centre of the arm's paddle, m, and number of
their directions; the arm never hides all of them."""
REACH = 3
"""Radius around a click in which the colour of the paddle is taken, px; a larger part
may be hidden by the arm."""
GRIPPED = np.array([[0.028, 0.0, PADDLE_TOP]])
"""Position (1, 3) of the click on the hand's paddle, field frame, m."""


def calibrate_lab(client: LabClient) -> Rig:
    """Return the rig of a lab.

    Args:
        client: Client of the lab.

    Raises:
        RuntimeError: The lab has ended.
        CameraError: The lab sends no frames.
        ValueError: Tags or colours are not seen as expected.
    """
    info, survey = client.ask("info"), client.ask("survey")
    table = TABLES[info["table"]]
    known = {k: tag_corners(place) for k, place in tag_places(table).items()}
    source = f"stream:{info['camera']}"
    more = {"block": BLOCK[0, :2].tolist()} if info["block"] else {}
    client.ask("place", puck=CLICKED[0, :2].tolist(), velocity=[0.0, 0.0], **more)
    time.sleep(0.2)
    with Camera(open_source(source)) as camera:
        frames = _take(camera, PICTURES)
    view = view_from_tags(_steady_tags(frames), known, lab_view(table).lens)
    # A person would click the puck, and a visible part of the paddle.
    image, block = frames[-1].image, None
    x, y = view.project(CLICKED)[0]
    if info["block"]:
        p, q = view.project(BLOCK)[0]
        block = Colour.around(image, (float(p), float(q)))
    u, v = _most_coloured(image, view.project(_rim(client)))
    touched = (survey[name] for name in ("places", "touched", "tool"))
    return Rig(
        table=info["table"],
        camera=source,
        view=view,
        puck=Colour.around(image, (float(x), float(y))),
        puck_marked=info["marked"],
        block=block,
        paddle=Colour.around(image, (float(u), float(v)), REACH),
        period=1.0 / info["frame_rate"],
        robot=info["host"],
        mounting=fit_mounting(*(np.array(x) for x in touched)),
        tags={str(k): four.tolist() for k, four in known.items()},
        operator=f"lab:{client.port}",
        made=date.today().isoformat(),
    )


def _rim(client: LabClient) -> Array:
    """Return points (n, 3) on the arm's paddle, some of them hidden, table frame, m."""
    angles = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
    offsets = RIM * np.stack([np.cos(angles), np.sin(angles)], 1)
    points = np.array(client.ask("truth")["paddle"][:2]) + offsets
    return np.column_stack([points, np.full(len(points), PADDLE_TOP)])


def _most_coloured(image: Array, pixels: Array) -> Array:
    """Return the pixel of (n, 2) whose neighbourhood has the highest least saturation.

    A mean could prefer a neighbourhood that contains a shadow or the arm's edge.
    """
    saturation = cv2.medianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), 3)[..., 1]
    least = cv2.erode(saturation, np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8))
    x, y = np.rint(pixels).astype(int).T
    return np.asarray(pixels[np.argmax(least[y, x])])


def calibrate_hand(client: LabClient) -> HandRig:
    """Return the rig of a lab's hand.

    Args:
        client: Client of the lab.

    Raises:
        RuntimeError: The lab has ended.
        CameraError: The lab sends no frames.
        ValueError: Tags or colours are not seen as expected.
    """
    source = f"stream:{client.ask('hand', middle=[0.0, 0.0])['camera']}"
    known = {k: tag_corners(place) for k, place in hand_tag_places().items()}
    with Camera(open_source(source)) as camera:
        frames = _take(camera, PICTURES)
    view = view_from_tags(_steady_tags(frames), known, hand_view().lens)
    x, y = view.project(GRIPPED)[0]
    return HandRig(
        camera=source,
        view=view,
        paddle=Colour.around(frames[-1].image, (float(x), float(y))),
        size=FIELD,
        tags={str(k): four.tolist() for k, four in known.items()},
        made=date.today().isoformat(),
    )


def _steady_tags(frames: list[CameraFrame]) -> dict[int, Array]:
    """Return the mean corners (4, 2), px, of the tags that are seen in all frames."""
    seen = [find_tags(frame.image) for frame in frames]
    steady = set(seen[0]).intersection(*seen[1:])
    return {k: np.mean([tags[k] for tags in seen], axis=0) for k in steady}


@contextmanager
def running_lab() -> Iterator[LabClient]:
    """Yield a client of the lab that runs on this machine.

    Without a running lab, one is started and closed at the end.

    Raises:
        RuntimeError: The lab does not start.
    """
    with ExitStack() as stack:
        client = LabClient.find()
        if client is None:
            lab = stack.enter_context(Lab())
            client = LabClient(stack.enter_context(served(lab)))
        stack.callback(client.close)
        yield client


@contextmanager
def lab_rig() -> Iterator[Path]:
    """Yield the rig's file of the `running_lab`.

    Raises:
        RuntimeError: The client of the arm is not installed, or the lab does not start.
    """
    require("rtde_control", "hardware")
    with running_lab() as client:
        path = cache_folder() / f"lab-{client.port}.json"
        calibrate_lab(client).save(path)
        yield path


@contextmanager
def opened_rig(rig: str | Path) -> Iterator[Path]:
    """Yield a rig's file: that of the `running_lab` for "lab", otherwise ``rig``.

    Raises:
        RuntimeError: The lab does not start.
    """
    if str(rig) != "lab":
        yield Path(rig)
        return
    with lab_rig() as path:
        yield path


@contextmanager
def hand_rig() -> Iterator[Path]:
    """Yield the rig's file of the hand in the `running_lab`.

    Raises:
        RuntimeError: The lab does not start.
    """
    with running_lab() as client:
        path = cache_folder() / f"hand-{client.port}.json"
        calibrate_hand(client).save(path)
        yield path


def _take(camera: Camera, count: int) -> list[CameraFrame]:
    frames: list[CameraFrame] = []
    while len(frames) < count:
        frame = camera.next(frames[-1].number if frames else -1)
        if frame is None:
            raise RuntimeError(camera.trouble or "camera: no frames")
        frames.append(frame)
    return frames
