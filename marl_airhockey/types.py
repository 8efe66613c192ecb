"""Types that every package uses."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]
Memory = dict[str, Array]
"""Named arrays ``(..., *)`` that a scenario or a driver keeps of an episode."""
Rows = Array | slice
"""Some of the worlds: indices (W,), or a slice."""
ALL = slice(None)
"""`Rows` of all worlds."""
