"""MP4: videos with H.264, which all browsers support."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.sim.core.errors import require
from marl_airhockey.types import Array

OPTIONS = {"crf": "20", "preset": "veryfast"}
"""Quality and speed of the encoder."""


class Mp4Writer:
    """Writer of an MP4 file with H.264.

    Args:
        path: Path of the file.
        fps: Number of images per second.

    Raises:
        RuntimeError: PyAV is not installed.
        OSError: The file cannot be written.
    """

    def __init__(self, path: Path, fps: float) -> None:
        require("av", "video")
        import av

        self._rate = Fraction(fps).limit_denominator(1000)
        self._file = av.open(str(path), "w", options={"movflags": "faststart"})
        self._stream: Any = None

    def append(self, image: Array) -> None:
        """Append an image (H, W, 3) uint8 RGB, cropped to an even height and width."""
        import av

        height, width = (2 * (size // 2) for size in image.shape[:2])
        if self._stream is None:
            self._stream = self._file.add_stream("libx264", self._rate, options=OPTIONS)
            self._stream.width, self._stream.height = width, height
            self._stream.pix_fmt = "yuv420p"
        image = np.ascontiguousarray(image[:height, :width])
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        self._file.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Write the remaining frames of the encoder, and close the file."""
        if self._stream is not None:
            self._file.mux(self._stream.encode(None))
        self._file.close()
