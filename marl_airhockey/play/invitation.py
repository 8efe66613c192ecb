"""QR code of the address of a page, for other pages and for the terminal."""

from __future__ import annotations

import cv2
import numpy as np

from marl_airhockey.types import Array


def code_of(text: str) -> Array:
    """Return the modules of a QR code (n, n), bool, True for dark, with a margin.

    Args:
        text: Text of the code. It contains the token, so that it opens the page.
    """
    image = cv2.QRCodeEncoder.create().encode(text)
    return np.pad(np.asarray(image) == 0, 2)


def rows_of(code: Array) -> list[str]:
    """Return a code as rows of "1" for dark and "0" for light."""
    return ["".join("1" if dark else "0" for dark in row) for row in code]


def in_terminal(code: Array) -> str:
    """Return a code as text for a terminal with dark background, two rows per line."""
    padded = np.pad(code, ((0, len(code) % 2), (0, 0)))
    blocks = {(0, 0): "█", (0, 1): "▀", (1, 0): "▄", (1, 1): " "}
    lines = zip(padded[::2], padded[1::2], strict=True)
    return "\n".join(
        "".join(blocks[int(a), int(b)] for a, b in zip(*pair, strict=True))
        for pair in lines
    )
