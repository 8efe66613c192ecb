"""Cholesky decomposition for compiled code, in place."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array


@inner()
def factor(a: Array) -> None:
    """Compute the lower Cholesky factor of a symmetric positive matrix, in place."""
    n = len(a)
    for j in range(n):
        for k in range(j):
            a[j, j] -= a[j, k] * a[j, k]
        a[j, j] = np.sqrt(a[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                a[i, j] -= a[i, k] * a[j, k]
            a[i, j] /= a[j, j]


@inner()
def solve(lower: Array, b: Array) -> None:
    """Solve a linear system with its Cholesky factor, in place."""
    n = len(b)
    for i in range(n):
        for k in range(i):
            b[i] -= lower[i, k] * b[k]
        b[i] /= lower[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= lower[k, i] * b[k]
        b[i] /= lower[i, i]
