"""Checksum and statistics of a dataset, and their published values."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

from marl_airhockey.data.files import recordings_in
from marl_airhockey.data.reader import episodes_of
from marl_airhockey.data.summary import summarize_recording
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.types import Array

PUBLISHED = Path(__file__).parent / "published.json"
"""File of the published contents, by name of the dataset."""


class Content(NamedTuple):
    """Content of a dataset."""

    steps: int
    episodes: int
    success: float
    """Share of successful episodes; for a game, share that the first seat wins."""
    returns: float
    """Mean return of an episode."""
    megabytes: float
    checksum: str
    """SHA-256 of all columns."""


def content_of(folder: Path) -> Content:
    """Return the content of a dataset.

    Raises:
        ValueError: There are no recordings, or one is damaged.
    """
    files = recordings_in([folder])
    found = [summarize_recording(path) for path in files]
    episodes = sum(each.episodes for each in found)
    return Content(
        steps=sum(each.steps for each in found),
        episodes=episodes,
        success=sum(each.episodes * each.success for each in found) / episodes,
        returns=sum(each.episodes * each.returns for each in found) / episodes,
        megabytes=sum(each.bytes for each in found) / 1e6,
        checksum=checksum_of(files),
    )


def checksum_of(files: list[Path]) -> str:
    """Return the SHA-256 of the seeds and columns of recordings, not of their files."""
    digest = hashlib.sha256()
    for path in files:
        for episode in episodes_of(path):
            digest.update(f"{episode.seed} {episode.number} {len(episode)}".encode())
            for part in (episode.first, episode.columns):
                for name in sorted(part):
                    digest.update(name.encode())
                    digest.update(_bytes(part[name]))
    return digest.hexdigest()


def _bytes(values: Array) -> bytes:
    return values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()


@cache
def published() -> dict[str, Content]:
    """Return the published contents, by name of the dataset."""
    rows = json.loads(PUBLISHED.read_text())
    return {name: Content(**row) for name, row in rows.items()}


def reference_returns(scenario: str) -> tuple[float, float]:
    """Return the mean returns of the random and of the expert dataset of a task.

    Raises:
        ValueError: The scenario has no such datasets.
    """
    known = references()
    if scenario not in known:
        raise ValueError(unknown_name("scenario of a dataset", scenario, known))
    return known[scenario]


def references() -> dict[str, tuple[float, float]]:
    """Return the mean returns of the random and expert datasets, by scenario."""
    contents = published()
    return {
        name.split("/")[1]: (
            contents[name.replace("/expert-", "/random-")].returns,
            content.returns,
        )
        for name, content in contents.items()
        if "/expert-" in name
    }


def normalized_score(scenario: str, returns: float) -> float:
    """Return the normalized score of a mean return: 0 for random, 100 for the expert.

    Args:
        scenario: Name of a task; its datasets have default options.
        returns: Mean return of an episode.

    Raises:
        ValueError: The scenario has no such datasets.
    """
    low, high = reference_returns(scenario)
    return 100.0 * (returns - low) / (high - low)
