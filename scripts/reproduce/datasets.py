"""Build all named datasets and keep what is published of them.

    python scripts/reproduce/datasets.py
    python scripts/reproduce/datasets.py --names airhockey/juggle/expert-v0 --check

Each dataset adds a row to ``docs/data/datasets.csv``: steps, episodes, success, mean
return, MB, seconds of CPU time to build it, and the checksum of its columns. The rows
become the `published.json` of the library. A dataset whose row is there is not built
again; with ``--check`` it is, and its checksum is compared. ``--table`` prints the
tables of the docs. Built datasets are removed afterwards unless they are kept.
"""

from __future__ import annotations

import csv
import json
import shutil
import time
from pathlib import Path
from statistics import mean
from typing import Annotated, Any, get_type_hints

import typer

from marl_airhockey.data.benchmark.build import build_dataset
from marl_airhockey.data.benchmark.catalogue import TIERS, datasets, find_dataset
from marl_airhockey.data.benchmark.content import (
    PUBLISHED,
    Content,
    content_of,
    normalized_score,
)

ROWS = Path(__file__).parents[2] / "docs" / "data" / "datasets.csv"
"""File of the committed rows"""
DIGITS = {"success": 6, "returns": 4, "megabytes": 1, "cpu_seconds": 1}


def measure(name: str, folder: Path) -> dict[str, Any]:
    """Build a dataset; return its row."""
    began = time.process_time()
    build_dataset(find_dataset(name), folder)
    seconds = time.process_time() - began
    row = {"name": name, **content_of(folder)._asdict(), "cpu_seconds": seconds}
    return {k: round(v, DIGITS[k]) if k in DIGITS else v for k, v in row.items()}


def read() -> dict[str, dict[str, Any]]:
    """Return the rows by name; none if there is no file."""
    if not ROWS.exists():
        return {}
    with ROWS.open(newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def keep(rows: dict[str, dict[str, Any]]) -> None:
    """Write the rows, in the order of the catalogue, and `published.json`."""
    ordered = [rows[name] for name in datasets() if name in rows]
    with ROWS.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(ordered[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(ordered)
    kinds = get_type_hints(Content)
    contents = {
        row["name"]: {name: kind(row[name]) for name, kind in kinds.items()}
        for row in ordered
    }
    PUBLISHED.write_text(json.dumps(contents, indent=1) + "\n")


def table_of(rows: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return the cells of the table of success by task and tier, the header first."""
    found = [["task", *TIERS]]
    for task in dict.fromkeys(dataset.scenario for dataset in datasets().values()):
        names = [f"airhockey/{task}/{tier}-v0" for tier in TIERS]
        if all(name in rows for name in names):
            cells = [f"{float(rows[name]['success']):.2f}" for name in names]
            found.append([task, *cells])
    return found


def tiers_of(rows: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return the cells of the table of sizes and scores by tier, the header first."""
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
    names: Annotated[str, typer.Option(help="Comma-separated names; all.")] = "",
    check: Annotated[
        bool, typer.Option("--check", help="Build known ones again.")
    ] = False,
    table: Annotated[
        bool, typer.Option("--table", help="Print the table alone.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder of the datasets.")] = Path(
        "runs/sets"
    ),
) -> None:
    """Build datasets and keep their rows."""
    rows = read()
    if table:
        for cells in (*table_of(rows), *tiers_of(rows)):
            print(f"| {' | '.join(cells)} |")
        return
    for name in names.split(",") if names else datasets():
        if name in rows and not check:
            continue
        row = measure(name, out / name)
        shutil.rmtree(out / name)
        if check and name in rows:
            same = row["checksum"] == rows[name]["checksum"]
            print(name, "same content" if same else "OTHER content", flush=True)
            continue
        rows[name] = row
        keep(rows)
        print(row, flush=True)


if __name__ == "__main__":
    typer.run(main)
