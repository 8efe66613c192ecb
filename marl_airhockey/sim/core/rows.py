"""Copying and clearing of rows in many arrays in one compiled call.

For a hundred rows, NumPy's indexing of one array costs as much as these functions cost
for a dozen arrays.
"""

from __future__ import annotations

from numba import literal_unroll

from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array


@compiled()
def copy_rows(worlds: Array, pairs: tuple[tuple[Array, Array], ...]) -> None:
    """Copy rows (W, n) into the rows of some worlds (B, n), for pairs (into, rows)."""
    for pair in literal_unroll(pairs):
        into, rows = pair
        for i in range(len(worlds)):
            for k in range(rows.shape[1]):
                into[worlds[i], k] = rows[i, k]


@compiled()
def clear_rows(worlds: Array, arrays: tuple[Array, ...]) -> None:
    """Set the rows of some worlds to 0 in arrays (B, n)."""
    for array in literal_unroll(arrays):
        for i in range(len(worlds)):
            array[worlds[i], :] = 0
