"""Geometry of the plane: convex polygons, half-planes, lengths."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def clip(polygon: Array, normal: Array, offset: float) -> Array:
    """Cut a convex polygon (n, 2) to its part where normal . point + offset >= 0.

    Raises:
        ValueError: Nothing of the polygon is left.
    """
    distance = polygon @ normal + offset
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
    length = np.linalg.norm(ahead, axis=-1, keepdims=True)
    if (length <= 0).any() or (_cross(ahead, np.roll(ahead, -1, axis=0)) < 0).any():
        raise ValueError("reach: must be a convex counter-clockwise polygon")
    normals = np.stack([-ahead[:, 1], ahead[:, 0]], -1) / length
    return normals, -np.einsum("kd,kd->k", normals, corners)


def length(vector: Array) -> Array:
    """Return the Euclidean norms (...) of vectors (..., 2)."""
    x, y = vector[..., 0], vector[..., 1]
    size: Array = np.sqrt(x * x + y * y)
    return size
