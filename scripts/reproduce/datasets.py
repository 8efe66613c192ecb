"""Build all named datasets and record their published properties.

    python scripts/reproduce/datasets.py
    python scripts/reproduce/datasets.py --names airhockey/juggle/expert-v0 --check

Each dataset adds a row to ``docs/data/datasets.csv``: steps, episodes, success, mean
return, MB, CPU-seconds of building, and the checksum of its columns. The rows are also
written to the `published.json` of the library. A dataset that has a row is not built
again without ``--again`` or ``--check``. ``--check`` only compares the checksum.
``--rows FILE`` writes the rows to another file. ``--table`` prints the tables of the
docs. Each dataset is deleted after it was measured.
"""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from statistics import mean
from typing import Annotated, Any, get_type_hints

import typer
from rows import DATA, Again, Book, Row, RowsFile, read, write

from marl_airhockey.data.benchmark.build import build_dataset
from marl_airhockey.data.benchmark.catalogue import TIERS, datasets, find_dataset
from marl_airhockey.data.benchmark.content import (
    PUBLISHED,
    Content,
    content_of,
    normalized_score,
)

BOOK = Book(DATA / "datasets.csv", ("name",))
DIGITS = {"success": 6, "returns": 4, "megabytes": 1, "cpu_seconds": 1}


def measure(name: str, folder: Path) -> dict[str, Any]:
    """Build a dataset and return its row."""
    began = time.process_time()
    build_dataset(find_dataset(name), folder)
    seconds = time.process_time() - began
    row = {"name": name, **content_of(folder)._asdict(), "cpu_seconds": seconds}
    return {k: round(v, DIGITS[k]) if k in DIGITS else v for k, v in row.items()}


def read_rows(path: Path) -> dict[str, Row]:
    """Return the rows of a file by name; an empty dict if there is no file."""
    return {row["name"]: row for row in read(path)}


def keep(path: Path, rows: dict[str, Row]) -> None:
    """Write the rows in the order of the catalogue; publish the committed ones."""
    ordered = [rows[name] for name in datasets() if name in rows]
    write(path, ordered)
    if path != BOOK.path:
        return
    kinds = get_type_hints(Content)
    contents = {
        row["name"]: {name: kind(row[name]) for name, kind in kinds.items()}
        for row in ordered
    }
    PUBLISHED.write_text(json.dumps(contents, indent=1) + "\n")


def table_of(rows: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return the cells of the table of success by task and tier, header first."""
    found = [["task", *TIERS]]
    for task in dict.fromkeys(dataset.scenario for dataset in datasets().values()):
        names = [f"airhockey/{task}/{tier}-v0" for tier in TIERS]
        if all(name in rows for name in names):
            cells = [f"{float(rows[name]['success']):.2f}" for name in names]
            found.append([task, *cells])
    return found


def tiers_of(rows: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return the cells of the table of sizes and scores by tier, header first."""
    found = [["tier", "episodes", "MB", "CPU time, s", "score, mean of tasks"]]
    for tier in TIERS:
        own = [row for name, row in rows.items() if f"/{tier}-v" in name]
        scores = [
            normalized_score(row["name"].split("/")[1], float(row["returns"]))
            for row in own
        ]
        ranges = [
            f"{min(values):.0f} .. {max(values):.0f}"
            for values in (
                [float(row[column]) for row in own]
                for column in ("episodes", "megabytes", "cpu_seconds")
            )
        ]
        found.append([tier, *ranges, f"{mean(scores):.0f}"])
    return found


def main(
    names: Annotated[
        str, typer.Option(help="Names, separated by commas; by default all.")
    ] = "",
    check: Annotated[
        bool,
        typer.Option("--check", help="Build datasets again and compare checksums."),
    ] = False,
    table: Annotated[
        bool, typer.Option("--table", help="Only print the tables.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder of the datasets.")] = Path(
        "runs/sets"
    ),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Build datasets and record their rows."""
    book, chosen = BOOK.at(rows), names.split(",") if names else [*datasets()]
    known = read_rows(book.path)
    if table:
        for cells in (*table_of(known), *tiers_of(known)):
            print(f"| {' | '.join(cells)} |")
        return
    for (name,) in book.missing([(name,) for name in chosen], again or check):
        row = measure(name, out / name)
        shutil.rmtree(out / name)
        if check and name in known:
            same = row["checksum"] == known[name]["checksum"]
            print(name, "same content" if same else "OTHER content", flush=True)
            continue
        known[name] = row
        keep(book.path, known)
        print(row, flush=True)


if __name__ == "__main__":
    typer.run(main)
