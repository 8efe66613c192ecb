"""Video files: GIF by Pillow, MP4 by OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from marl_airhockey.types import Array


def write_video(path: Path | str, pictures: Sequence[Array], fps: float) -> Path:
    """Write pictures (H, W, 3) uint8 RGB as a .gif or an .mp4; return its path.

    Args:
        path: file to write; its folder is made.
        pictures: of one size.
        fps: pictures per second.

    Raises:
        ValueError: no pictures, or another ending.
        OSError: the file could not be written.
    """
    path = Path(path)
    if not pictures:
        raise ValueError("video: no pictures to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".gif":
        # One palette and no dithering: frames then differ only where things move.
        some = [pictures[0], pictures[len(pictures) // 2], pictures[-1]]
        palette = Image.fromarray(np.concatenate(some)).quantize(128)
        frames = [
            Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE)
            for p in pictures
        ]
        rest, duration = frames[1:], round(1000 / fps)
        frames[0].save(
            path, append_images=rest, save_all=True, duration=duration, loop=0
        )
    elif path.suffix == ".mp4":
        size = (pictures[0].shape[1], pictures[0].shape[0])
        code = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(path), code, fps, size)
        if not writer.isOpened():
            raise OSError(f"video: {path} could not be written")
        for picture in pictures:
            writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        writer.release()
    else:
        raise ValueError(f"video: {path.name!r} must end in .gif or .mp4")
    return path
