"""Video files: GIF and WebP with Pillow, MP4 with PyAV."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from marl_airhockey.sim.render.mp4 import Mp4Writer
from marl_airhockey.types import Array

WIDTHS = {".mp4": 1280}
"""Width of a video by the suffix of its file, pixels."""
USUAL_WIDTH = 640
"""Width of other videos, pixels."""
QUALITY = 10
"""Quality of WebP, 0 to 100."""


def write_video(path: Path | str, pictures: Sequence[Array], fps: float) -> Path:
    """Write images as a video; return the path.

    Args:
        path: Path of the file, .gif, .webp or .mp4. Its folder is created.
        pictures: Images (H, W, 3) uint8 RGB of one size.
        fps: Number of images per second.

    Raises:
        ValueError: There are no images, or the suffix is unknown.
        OSError: The file could not be written.
    """
    path = Path(path)
    if not pictures:
        raise ValueError("video: no images were given")
    path.parent.mkdir(parents=True, exist_ok=True)
    check_ending(path)
    WRITERS[path.suffix](path, pictures, fps)
    return path


def width_of(path: Path | str) -> int:
    """Return the default width of a video, pixels."""
    return WIDTHS.get(Path(path).suffix, USUAL_WIDTH)


def check_ending(path: Path) -> None:
    """Check that the suffix of a file is that of a video.

    Raises:
        ValueError: The suffix is not one of `WRITERS`.
    """
    if path.suffix not in WRITERS:
        endings = ", ".join(WRITERS)
        raise ValueError(f"video: {path.name!r} must end in one of {endings}")


def _write_gif(path: Path, pictures: Sequence[Array], fps: float) -> None:
    # With one palette and no dithering, frames differ only where bodies move.
    some = [pictures[0], pictures[len(pictures) // 2], pictures[-1]]
    palette = Image.fromarray(np.concatenate(some)).quantize(128)
    frames = [
        Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE)
        for p in pictures
    ]
    rest, duration = frames[1:], round(1000 / fps)
    frames[0].save(path, append_images=rest, save_all=True, duration=duration, loop=0)


def _write_webp(path: Path, pictures: Sequence[Array], fps: float) -> None:
    # For camera images, whose noise makes a GIF forty times larger.
    first, *rest = (Image.fromarray(picture) for picture in pictures)
    duration = round(1000 / fps)
    first.save(
        path,
        append_images=rest,
        save_all=True,
        duration=duration,
        loop=0,
        quality=QUALITY,
    )


def _write_mp4(path: Path, pictures: Sequence[Array], fps: float) -> None:
    writer = Mp4Writer(path, fps)
    for picture in pictures:
        writer.append(picture)
    writer.close()


WRITERS: dict[str, Callable[[Path, Sequence[Array], float], None]] = {
    ".gif": _write_gif,
    ".webp": _write_webp,
    ".mp4": _write_mp4,
}
"""Writers of videos by the suffix of the file."""
