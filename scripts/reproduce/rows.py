"""Rows of results in a CSV file, one for each cell of a table that is computed."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

Row = dict[str, Any]
Cell = tuple[Any, ...]
DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows."""
Again = Annotated[
    bool, typer.Option("--again", help="Compute existing rows again, in new folders.")
]
RowsFile = Annotated[
    Path | None,
    typer.Option("--rows", help="CSV file of the rows, instead of that in docs/data."),
]


def read(path: Path) -> list[Row]:
    """Return the rows of a CSV file; an empty list if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: Sequence[Row]) -> None:
    """Replace a CSV file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".part")
    with draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(path)


def run_folder(folder: Path, again: bool) -> Path:
    """Return the folder of runs; with ``--again`` it is a separate one."""
    return folder / "again" if again else folder


@dataclass(frozen=True)
class Book:
    """Rows in a file, one for each cell.

    Args:
        path: Path of the file.
        key: Columns that identify a cell.
        order: Function that returns the sort key of a row, whose values are strings;
            None for the order of the file.
    """

    path: Path
    key: tuple[str, ...]
    order: Callable[[Row], Any] | None = None

    def at(self, path: Path | None) -> Book:
        """Return the same book for another file, if one is given."""
        return Book(path, self.key, self.order) if path else self

    def _cell(self, row: Row) -> tuple[str, ...]:
        return tuple(str(row[name]) for name in self.key)

    def keep(self, row: Row) -> None:
        """Add a row, or replace the row of the same cell."""
        new = {name: str(value) for name, value in row.items()}
        rows = read(self.path)
        cells = [self._cell(old) for old in rows]
        if self._cell(new) in cells:
            rows[cells.index(self._cell(new))] = new
        else:
            rows.append(new)
        write(self.path, sorted(rows, key=self.order) if self.order else rows)

    def missing(self, cells: Sequence[Cell], again: bool = False) -> list[Cell]:
        """Return the cells to compute; print the number of existing rows.

        Args:
            cells: All requested cells.
            again: True to also compute cells that have a row.
        """
        known = {self._cell(row) for row in read(self.path)}
        there = [cell for cell in cells if tuple(map(str, cell)) in known]
        wanted = list(cells) if again else [c for c in cells if c not in there]
        print(f"{self.path}: {len(there)} of {len(cells)} rows are there", flush=True)
        for cell in wanted:
            print("  to compute:", " ".join(map(str, cell)), flush=True)
        if not wanted:
            print(
                "nothing to compute; --again computes the rows again, --rows FILE "
                "writes them to another file"
            )
        return wanted

    def fill(
        self,
        cells: Sequence[Cell],
        work: Callable[..., Any],
        jobs: int,
        kept: Callable[[Any], None] | None = None,
    ) -> None:
        """Compute cells in separate processes; save and print each row immediately.

        Args:
            cells: Cells, whose elements are the arguments of ``work``.
            work: Function that returns the row of a cell.
            jobs: Number of cells at a time.
            kept: Function that saves the result of ``work``, if it is a tuple that
                begins with a row.
        """
        began = time.monotonic()
        with ProcessPoolExecutor(jobs, max_tasks_per_child=1) as pool:
            running = [pool.submit(work, *cell) for cell in cells]
            try:
                for k, done in enumerate(as_completed(running), 1):
                    row = done.result()
                    (kept or self.keep)(row)
                    minutes = (time.monotonic() - began) / 60
                    shown = row if kept is None else row[0]
                    print(
                        f"{k} of {len(cells)}, {minutes:.1f} min: {shown}", flush=True
                    )
            except BaseException:
                # Finished rows are saved; do not wait for the others.
                pool.shutdown(cancel_futures=True)
                raise


def fill_and_print(
    book: Book, cells: Sequence[Cell], work: Callable[..., Row], jobs: int, again: bool
) -> None:
    """Compute the missing cells of a book; if there were any, print all its rows."""
    if missing := book.missing(cells, again):
        book.fill(missing, work, jobs)
        rows = read(book.path)
        table = Table(*rows[0])
        for row in rows:
            table.add_row(*row.values())
        Console(width=120).print(table)


def compute(
    book: Book,
    cells: Sequence[Cell],
    work: Callable[..., Row],
    folder: Path,
    jobs: int,
    again: bool,
) -> None:
    """Compute the missing cells of a book; ``work`` also takes a folder."""
    place = run_folder(folder, again)
    book.fill(book.missing(cells, again), partial(in_folder, work, place), jobs)


def in_folder(work: Callable[..., Row], folder: Path, *cell: Any) -> Row:
    """Return the row of a cell, computed in a folder."""
    return work(*cell, folder)
