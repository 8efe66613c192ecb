"""Palette: colours of seats for people with and without colour vision deficiency."""

from itertools import combinations

import numpy as np
import pytest

from marl_airhockey.sim.contracts.palette import SCHEMES, SEATS, rgb

VISION = {
    "normal": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
"""Matrices of linear RGB (Machado and others, 2009)."""
TO_XYZ = [
    [0.4124, 0.3576, 0.1805],
    [0.2126, 0.7152, 0.0722],
    [0.0193, 0.1192, 0.9505],
]
WHITE = [0.9505, 1.0, 1.089]


def cielab(colour, vision):
    value = np.array(rgb(colour)) / 255
    linear = np.where(value < 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    xyz = np.array(TO_XYZ) @ np.clip(np.array(vision) @ linear, 0, 1) / WHITE
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", VISION)
def test_seat_colours_differ_in_cielab(vision):
    seen = [cielab(colour, VISION[vision]) for colour in SEATS]
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 15


def test_schemes_have_the_same_names():
    assert set(SCHEMES["light"]) == set(SCHEMES["dark"])
    assert rgb("#0072b2") == (0, 114, 178)
