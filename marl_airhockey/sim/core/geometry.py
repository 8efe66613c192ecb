"""Geometry of the plane: convex polygons, half-planes, lengths."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from marl_airhockey.types import Array


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def clip(polygon: Array, normal: Array, offset: float) -> Array:
    """Cut a convex polygon (n, 2) to its part where normal . point + offset >= 0.

    Raises:
        ValueError: Nothing of the polygon is left.
    """
    distance = products(polygon, normal[None])[:, 0] + offset
    kept: list[Array] = []
    for here, there, a, b in zip(
        polygon,
        np.roll(polygon, -1, axis=0),
        distance,
        np.roll(distance, -1),
        strict=True,
    ):
        if a >= 0:
            kept.append(here)
        if a * b < 0:
            kept.append(here + (there - here) * a / (a - b))
    if len(kept) < 3:
        raise ValueError("reach: nothing of the polygon is left")
    return np.array(kept)


def half_planes(polygon: tuple[tuple[float, float], ...]) -> tuple[Array, Array]:
    """Return the half-planes whose intersection is a counter-clockwise polygon.

    Returns:
        Inward unit normals (K, 2) and offsets (K,): a point lies inside where
        ``normals @ point + offsets >= 0``.

    Raises:
        ValueError: The polygon is not convex and counter-clockwise.
    """
    corners = np.asarray(polygon, dtype=float)
    ahead = np.roll(corners, -1, axis=0) - corners
    size = length(ahead)[:, None]
    if (size <= 0).any() or (_cross(ahead, np.roll(ahead, -1, axis=0)) < 0).any():
        raise ValueError("reach: must be a convex counter-clockwise polygon")
    normals = np.stack([-ahead[:, 1], ahead[:, 0]], -1) / size
    return normals, -(normals * corners).sum(-1)


def length(vector: Array) -> Array:
    """Return the Euclidean norms (...) of vectors (..., 2)."""
    x, y = vector[..., 0], vector[..., 1]
    size: Array = np.sqrt(x * x + y * y)
    return size


def products(vectors: Array, rows: Array) -> Array:
    """Return the products (..., K) of vectors (..., 2) and matrices (..., K, 2).

    In contrast to `@` of arrays, the last bits do not depend on the processor.
    """
    if vectors.dtype == object:
        # For symbols `@` is exact, and it leaves out the known zeros.
        exact: Array = rows @ vectors[..., None]
        return exact[..., 0]
    x, y = vectors[..., 0, None], vectors[..., 1, None]
    total: Array = x * rows[..., 0] + y * rows[..., 1]
    return total


def interpolate(x: Array, at: Sequence[float], values: Sequence[float]) -> Array:
    """Return a piecewise linear function of x (...), constant beyond its ends.

    Args:
        x: Points (...) at which the function is evaluated.
        at: Points between which the function is linear, in increasing order.
        values: Values of the function at these points.
    """
    total = values[0] + 0.0 * x
    for (a, b), (low, high) in zip(pairwise(at), pairwise(values), strict=True):
        total += np.clip((x - a) / (b - a), 0.0, 1.0) * (high - low)
    return total
