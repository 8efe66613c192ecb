"""Process that renders the 3D scene of a match."""

from __future__ import annotations

import os
import signal
from multiprocessing.connection import Connection
from typing import Any

import cv2

from marl_airhockey.sim.backends.robosuite.frames import TableFrame

WIDTH, HEIGHT, QUALITY = 640, 400, 80
"""Size of the images, pixels, and their JPEG quality."""
FINER = 1.5
"""Factor of the size in which images are rendered, so that edges are smooth."""
POLITE = 5
"""Niceness of the process; the loop of ticks has precedence."""


def run_renderer(model: Any, frame: TableFrame, pipe: Connection) -> None:
    """Render until the other end of the pipe closes or sends None.

    A request is a pair of ``qpos`` and marks. The response is a JPEG, or a text with
    the reason why the process ends.

    Args:
        model: MuJoCo model.
        frame: Frame of the table.
        pipe: Pipe to the process of the match.
    """
    # Ctrl-C reaches all processes of a terminal; the match ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(POLITE)
    # Mesa's renderer for CPUs would otherwise use all cores.
    os.environ.setdefault("LP_NUM_THREADS", "0")
    try:
        _render(model, frame, pipe)
    except (EOFError, OSError):  # The process of the match has ended.
        return
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}")


def _render(model: Any, frame: TableFrame, pipe: Connection) -> None:
    """Render every request.

    Raises:
        EOFError: The other end of the pipe is closed.
        OSError: The other end of the pipe is closed while this process sends.
        RuntimeError: OpenGL is missing.
    """
    from marl_airhockey.sim.backends.robosuite.light_model import SHADOW, make_light
    from marl_airhockey.sim.backends.robosuite.offscreen import (
        OffscreenRenderer,
        whole_table,
    )

    make_light(model)
    size = round(FINER * WIDTH), round(FINER * HEIGHT)
    renderer = OffscreenRenderer(model, frame, *size, SHADOW)
    camera = whole_table(model)
    while (request := pipe.recv()) is not None:
        large = renderer.picture(request[0], camera, request[1])
        image = cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
        done, packed = cv2.imencode(".jpg", image[..., ::-1], quality)
        pipe.send(packed.tobytes() if done else "an image cannot be encoded")
    renderer.close()
