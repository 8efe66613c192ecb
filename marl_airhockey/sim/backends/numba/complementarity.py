"""Linear complementarity problems: the impulses of contacts that only push."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

SMALL = 1e-11
"""Number that counts as 0, in problems whose numbers are about 1."""
ERROR = 1e-8
"""Largest amount by which an element of w may be below 0."""


@inner(error_model="numpy")
def complement(tableau: Array, names: Array, n: int) -> bool:
    """Find z >= 0 with w = M z + q >= 0 and w z = 0, by Lemke's method.

    If M is positive semi-definite and there is a solution, the method finds it (Cottle,
    Pang and Stone, The Linear Complementarity Problem, 1992, chapter 4.4).

    Args:
        tableau: Array (n or more, n + 2) of M, a column of ones and q, changed. The
            solution z is in column 0.
        names: Work space (2 n + 1 or more,).
        n: Number of unknowns.

    Returns:
        True if a solution was found.
    """
    # A row is a variable as the sum of the column variables and the last number. The
    # variables are w: 0 to n - 1, z: n to 2 n - 1, and an auxiliary variable, 2 n.
    auxiliary, last = 2 * n, n + 1
    worst, row, column = -SMALL, -1, n
    for k in range(n):
        names[k], names[n + k] = k, n + k
        if tableau[k, last] < worst:
            worst, row = tableau[k, last], k
    names[auxiliary] = auxiliary
    for _ in range(10 * n + 10):
        if row < 0:
            break
        _exchange(tableau, row, column, n)
        left = names[row]
        names[row], names[n + column] = names[n + column], left
        if left == auxiliary:
            break
        entering = left + n if left < n else left - n
        for k in range(n + 1):
            if names[n + k] == entering:
                column = k
        row = _first_to_vanish(tableau, names, column, n)
    error = 0.0
    for k in range(n):
        tableau[k, 0] = 0.0
    for k in range(n):
        if n <= names[k] < auxiliary:
            tableau[names[k] - n, 0] = max(tableau[k, last], 0.0)
        elif names[k] == auxiliary:
            error = tableau[k, last]
    # With redundant contacts, the search may end with a small error.
    return error < ERROR


@inner(error_model="numpy")
def _first_to_vanish(tableau: Array, names: Array, column: int, n: int) -> int:
    """Return the row that is 0 first if a column's variable grows; -1 for none.

    Of several rows it is the row of the auxiliary variable, which ends the search, or
    else the row with the largest coefficient.
    """
    least = np.inf
    for k in range(n):
        if tableau[k, column] < -SMALL:
            least = min(least, -tableau[k, n + 1] / tableau[k, column])
    found, largest = -1, 0.0
    for k in range(n):
        size = -tableau[k, column]
        if size > SMALL and tableau[k, n + 1] <= (least + SMALL) * size:
            size = np.inf if names[k] == 2 * n else size
            if size > largest:
                found, largest = k, size
    return found


@inner(error_model="numpy")
def _exchange(tableau: Array, row: int, column: int, n: int) -> None:
    """Exchange the variables of a row and a column."""
    size = 1.0 / tableau[row, column]
    for c in range(n + 2):
        tableau[row, c] *= -size
    tableau[row, column] = size
    for k in range(n):
        share = tableau[k, column]
        if k != row and share != 0.0:
            tableau[k, column] = 0.0
            for c in range(n + 2):
                tableau[k, c] += share * tableau[row, c]
