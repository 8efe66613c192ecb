"""Population of the challenge: players of duel of eight styles, with a known hash.

Their seeds are published nowhere, so that these players cannot be trained again.
``scripts/reproduce/population.py`` trains a population of a later version.
"""

from __future__ import annotations

import hashlib

from marl_airhockey.policies.load import ZOO

FOLDER = ZOO / "population"
"""Folder of the policies, one file for each style."""
STYLES = (
    "attacker",
    "keeper",
    "banker",
    "soft",
    "hasty",
    "early",
    "late",
    "exploiter",
)
SHA256 = "cea09e02183dbec2afc9cbcf9e453eabfe6d939217b298202a9409a7c73309bf"
"""Result of `digest` for version 1 of the population."""


def digest() -> str:
    """Return the SHA-256 of the files of all styles; missing files count as empty."""
    total = hashlib.sha256()
    for style in STYLES:
        path = FOLDER / f"{style}.npz"
        total.update(path.read_bytes() if path.exists() else b"")
    return total.hexdigest()


def opponents() -> dict[str, str]:
    """Return the paths of the players by name, such as ``population/attacker``.

    Raises:
        ValueError: A file is not the published one.
    """
    if digest() != SHA256:
        raise ValueError(
            f"{FOLDER}: the players are not those of the challenge; install "
            "marl_airhockey again"
        )
    return {f"population/{style}": str(FOLDER / f"{style}.npz") for style in STYLES}
