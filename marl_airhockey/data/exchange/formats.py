"""Formats of other libraries, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from marl_airhockey.data.exchange.lerobot import export_lerobot
from marl_airhockey.data.exchange.lerobot_reader import import_lerobot
from marl_airhockey.data.exchange.lerobot_writer import INFO
from marl_airhockey.data.exchange.minari import export_minari, import_minari
from marl_airhockey.data.exchange.rows import export_rows, import_rows
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.exchange.trajectories import (
    export_trajectories,
    import_trajectories,
)
from marl_airhockey.sim.core.errors import unknown_name


class Export(Protocol):
    """Function that writes recordings as a dataset and returns its path."""

    def __call__(
        self, files: Sequence[Path], name: str, root: Path | None, seat: int | None
    ) -> Path: ...


@dataclass(frozen=True)
class Format:
    """Format of another library."""

    export: Export
    read: Callable[[ImportSettings], Path]
    """Function that writes a dataset as a recording and returns its path."""
    fits: Callable[[Path], bool]
    """Function that returns True if a source looks like a dataset of the format."""


def _any(path: Path, suffixes: tuple[str, ...]) -> bool:
    """Return True if a file, or any file in a folder, has one of some suffixes."""
    files = path.iterdir() if path.is_dir() else [path]
    return any(file.suffix in suffixes for file in files)


FORMATS = {
    "lerobot": Format(
        export_lerobot, import_lerobot, lambda path: (path / INFO).is_file()
    ),
    "hdf5": Format(
        export_trajectories,
        import_trajectories,
        lambda path: path.exists() and _any(path, (".hdf5", ".h5")),
    ),
    "rows": Format(
        export_rows, import_rows, lambda path: path.exists() and _any(path, (".csv",))
    ),
    # Minari is the last format, because a Minari dataset is a name and not a path.
    "minari": Format(export_minari, import_minari, lambda path: True),
}
"""Formats by name, in the order in which an import tries them."""


def find_format(name: str) -> Format:
    """Return a format by its name.

    Raises:
        ValueError: No format has this name.
    """
    if name not in FORMATS:
        raise ValueError(unknown_name("format", name, FORMATS))
    return FORMATS[name]


def import_dataset(settings: ImportSettings) -> Path:
    """Write a dataset of another library as a recording; return its path.

    Raises:
        ValueError: The dataset cannot be read, or does not fit the scenario.
    """
    source = Path(settings.source)
    fitting = [name for name, each in FORMATS.items() if each.fits(source)]
    if fitting == ["minari"] and source.exists():
        raise ValueError(
            f"{source}: this is not a LeRobot dataset (no {INFO}), an HDF5 file or a "
            "CSV file; give a Minari dataset by its name"
        )
    return FORMATS[fitting[0]].read(settings)
