"""Layout of an observation."""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.observable import (
    OBSERVE,
    EgoView,
    Observable,
    ObservationContext,
)
from marl_airhockey.core.errors import unknown_name
from marl_airhockey.types import Array


class ObservationLayout:
    """Observables side by side: bounds, labels, and the numbers of an ego view."""

    def __init__(
        self, pieces: tuple[Observable, ...], scope: ObservationContext
    ) -> None:
        if scope.observe not in OBSERVE:
            raise ValueError(unknown_name("observe", scope.observe, OBSERVE))
        self.scope = scope
        columns = [piece.columns(scope) for piece in pieces]
        ends = np.cumsum([len(c) for c in columns]).tolist()
        starts = [0, *ends[:-1]]
        self._parts = [
            (piece, slice(a, b))
            for piece, a, b in zip(pieces, starts, ends, strict=True)
        ]
        flat = [column for part in columns for column in part]
        self.labels = tuple(column.label for column in flat)
        self.low = np.array([c.low for c in flat], np.float32)
        self.high = np.array([c.high for c in flat], np.float32)
        self.unit = np.array([c.unit for c in flat], np.float32)
        self.centre = np.array([c.centre for c in flat], np.float32)

    def read(self, ego: EgoView) -> Array:
        """(..., S, columns) float32, inside the bounds."""
        seats = len(self.scope.scene.seats)
        shape = (*ego.state.time.shape, seats, len(self.labels))
        out = np.empty_like(ego.state.position, shape=shape)
        for piece, part in self._parts:
            piece.write(ego, out[..., part])
        inside = np.minimum(np.maximum(out, self.low), self.high)
        return inside.astype(np.float32)
