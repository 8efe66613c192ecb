"""Builder of named datasets, which are played from fixed seeds."""

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
    """Play a dataset into a folder, which exists only when it is complete.

    Args:
        dataset: Dataset to build.
        folder: New folder of the dataset.
        steps: Least number of steps of the dataset.
        progress: Function that is called with the completed fraction.

    Returns:
        ``folder``.

    Raises:
        ValueError: The folder exists.
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
    """Return the folder of a named dataset; build the dataset if it does not exist.

    Raises:
        ValueError: No dataset has this name.
    """
    dataset, folder = find_dataset(name), dataset_folder(name)
    if not folder.exists():
        build_dataset(dataset, folder, progress=progress)
    return folder


def built(path: str | Path) -> Path:
    """Return a path, or the folder of a named dataset, which is built if necessary."""
    named = not Path(path).exists() and str(path).startswith(f"{PREFIX}/")
    return get_dataset(str(path)) if named else Path(path)
