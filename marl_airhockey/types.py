"""Types that all packages use."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]
Memory = dict[str, Array]
"""Arrays ``(..., *)`` by name that a scenario or a driver stores for an episode."""
Rows = Array | slice
"""Selection of worlds: indices (W,) or a slice."""
ALL = slice(None)
"""Selection of all worlds, see `Rows`."""
