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
        self, observables: tuple[Observable, ...], scope: ObservationContext
    ) -> None:
        if scope.observe not in OBSERVE:
            raise ValueError(unknown_name("observe", scope.observe, OBSERVE))
        self.scope = scope
        columns = [observable.columns(scope) for observable in observables]
        ends = np.cumsum([len(c) for c in columns]).tolist()
        starts = [0, *ends[:-1]]
        self._parts = [
            (observable, slice(a, b))
            for observable, a, b in zip(observables, starts, ends, strict=True)
        ]
        flat = [column for part in columns for column in part]
        self.meanings = tuple(
            (type(observable).__doc__ or "").partition("\n\n")[0]
            for observable, part in zip(observables, columns, strict=True)
            for _ in part
        )
        """What each column is of: the first sentence of its observable's docstring"""
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
        for observable, part in self._parts:
            observable.write(ego, out[..., part])
        inside = np.minimum(np.maximum(out, self.low), self.high)
        return inside.astype(np.float32)
