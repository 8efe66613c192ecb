"""Builder of named datasets: it plays them from their seeds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from marl_airhockey.data.benchmark.catalogue import (
    PROFILE,
    STEPS,
    NamedDataset,
    find_dataset,
)
from marl_airhockey.data.benchmark.croissant import write_card
from marl_airhockey.data.files import PREFIX, dataset_folder, whole_folder
from marl_airhockey.data.record import record_steps
from marl_airhockey.sim.world.keywords import Keywords


def build_dataset(
    dataset: NamedDataset,
    folder: Path,
    steps: int = STEPS,
    progress: Callable[[float], None] = lambda done: None,
) -> Path:
    """Play a dataset into a folder, which is there when it is complete.

    Args:
        dataset: Dataset.
        folder: New folder.
        steps: Least number of its steps.
        progress: Function that is called with the fraction that is done.

    Returns:
        ``folder``.

    Raises:
        ValueError: There is such a folder.
    """
    with whole_folder(folder) as new:
        done = 0.0
        for part in dataset.parts:
            keywords: Keywords = {"profile": PROFILE, "drivers": part.others}
            record_steps(
                part.make(),
                part.player,
                dataset.scenario,
                round(part.share * steps),
                new / part.player,
                dataset.seed(part),
                keywords,
            )
            done += part.share
            progress(min(done, 1.0))
        write_card(dataset, new)
    return folder


def get_dataset(
    name: str, progress: Callable[[float], None] = lambda done: None
) -> Path:
    """Return the folder of a named dataset; it is built if it is not there yet.

    Raises:
        ValueError: There is no dataset of that name.
    """
    dataset, folder = find_dataset(name), dataset_folder(name)
    if not folder.exists():
        build_dataset(dataset, folder, progress=progress)
    return folder


def built(path: str | Path) -> Path:
    """Return the folder of recordings that a path or the name of a dataset means."""
    named = not Path(path).exists() and str(path).startswith(f"{PREFIX}/")
    return get_dataset(str(path)) if named else Path(path)
