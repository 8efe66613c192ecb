"""Types that every room uses."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]
Memory = dict[str, Array]
"""Named arrays ``(..., *)`` that a scenario or a driver keeps of an episode."""
