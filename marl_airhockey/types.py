"""Types: see the definitions."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]


Memory = dict[str, Array]
"""What a scenario remembers of an episode: named arrays ``(..., *)``."""
