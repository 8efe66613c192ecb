"""Logs of a run: a CSV file and events of tensorboard."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path
from typing import Protocol

from torch.utils.tensorboard import SummaryWriter


class Log(Protocol):
    """Log that collects values by name, such as `Logger` of stable-baselines3."""

    def record(self, key: str, value: float) -> None:
        """Set a value of the next row."""

    def record_mean(self, key: str, value: float) -> None:
        """Add a value to a mean of the next row."""

    def dump(self, step: int) -> None:
        """Write the next row.

        Args:
            step: Number of steps since the beginning of the run.
        """

    def close(self) -> None:
        """Close the files."""


def progress_path(folder: Path, steps: int) -> Path:
    """Return the path of the CSV log of a run; a resumed run begins another file.

    Args:
        folder: Folder of the run.
        steps: Number of steps of the run when the process begins.
    """
    return folder / (f"progress-{steps}.csv" if steps else "progress.csv")


class RunLog:
    """Log of the part of a run that one process trains.

    Args:
        folder: Folder of the run.
        steps: Number of steps of the run when the process begins.
    """

    def __init__(self, folder: Path, steps: int) -> None:
        self._path = progress_path(folder, steps)
        self._events = SummaryWriter(str(folder))
        self._values: dict[str, float] = {}
        self._sums: dict[str, tuple[float, int]] = defaultdict(lambda: (0.0, 0))
        self._columns: list[str] = []
        self._rows: list[dict[str, float]] = []

    def record(self, key: str, value: float) -> None:
        """Set a value of the next row."""
        self._values[key] = value

    def record_mean(self, key: str, value: float) -> None:
        """Add a value to a mean of the next row."""
        total, count = self._sums[key]
        self._sums[key] = total + value, count + 1

    def dump(self, step: int) -> None:
        """Write the next row to the CSV file and to tensorboard."""
        means = {key: total / count for key, (total, count) in self._sums.items()}
        row = {"steps": step, **dict(sorted({**self._values, **means}.items()))}
        for key, value in row.items():
            if key != "steps":
                self._events.add_scalar(key, value, step)
        self._write(row)
        self._values.clear()
        self._sums.clear()

    def _write(self, row: dict[str, float]) -> None:
        """Append a row; if it has a new column, write all rows again."""
        self._rows.append(row)
        fresh = [key for key in row if key not in self._columns]
        self._columns += fresh
        with self._path.open("w" if fresh else "a", newline="") as file:
            writer = csv.DictWriter(file, self._columns, restval="")
            if fresh:
                writer.writeheader()
            writer.writerows(self._rows if fresh else [row])

    def close(self) -> None:
        """Close the files."""
        self._events.close()
