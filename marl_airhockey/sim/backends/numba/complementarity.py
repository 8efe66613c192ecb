"""Linear complementarity problems: which of some contacts push, and how hard."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

SMALL = 1e-11
"""Number that is none, of problems whose numbers are about 1"""
ERROR = 1e-8
"""Most by which an element of w may be below 0"""


@inner(error_model="numpy")
def complement(tableau: Array, names: Array, n: int) -> bool:
    """Find z >= 0 with w = M z + q >= 0 and w z = 0, by Lemke's method.

    For a positive semi-definite M it ends with a solution if there is one (Cottle, Pang
    and Stone, The Linear Complementarity Problem, 1992, chapter 4.4).

    Args:
        tableau: (n or more, n + 2): M, a column of ones and q; changed. The solution is
            in the column 0: z.
        names: work space (2 n + 1 or more,).
        n: number of unknowns.

    Returns:
        True if a solution was found.
    """
    # Rows are variables as sums of those of the columns and the last number. Variables
    # are w: 0 to n - 1, z: n to 2 n - 1, and an auxiliary one, 2 n.
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
    # Redundant contacts may end the search with next to nothing left.
    return error < ERROR


@inner(error_model="numpy")
def _first_to_vanish(tableau: Array, names: Array, column: int, n: int) -> int:
    """Return the row that is 0 first as a column's variable grows; -1 for none.

    Of several, that of the auxiliary variable, which ends the search, or else that of
    the largest coefficient.
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
