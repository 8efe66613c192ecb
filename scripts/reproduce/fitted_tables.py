"""Compare fitted tables of virtual labs with their true physics parameters.

    python scripts/reproduce/fitted_tables.py 11=lab11.toml 12=lab12.toml 13=lab13.toml

An argument is the seed of a lab and the profile that `airhockey fit-table` wrote. Each
parameter of a lab becomes a row of ``docs/data/fitted_tables.csv`` with its true value
and its interval. The mean half-widths of the intervals are those of `ur5e-calibrated`.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from own_table import true_laws
from rows import DATA, Row, RowsFile, write


def rows_of(seed: int, path: Path) -> list[Row]:
    """Return the rows of a lab: true value and interval of each fitted parameter."""
    true = true_laws(seed)
    ranges = tomllib.loads(path.read_text())["ranges"]
    return [
        {"lab": seed, "parameter": k, "true": round(true[k], 4), "low": a, "high": b}
        for k, (a, b) in ranges.items()
        if a < b
    ]


def main(
    labs: Annotated[list[str], typer.Argument(help="SEED=FILE of each lab.")],
    out: RowsFile = None,
) -> None:
    """Write the rows, and print the half-widths of the intervals."""
    pairs = [text.partition("=") for text in labs]
    rows = [row for seed, _, path in pairs for row in rows_of(int(seed), Path(path))]
    write(out or DATA / "fitted_tables.csv", rows)
    for name in dict.fromkeys(row["parameter"] for row in rows):
        of = [row for row in rows if row["parameter"] == name]
        half = float(np.mean([row["high"] - row["low"] for row in of])) / 2
        inside = sum(row["low"] <= row["true"] <= row["high"] for row in of)
        print(f"{name}: half-width {half:.4f}; {inside} of {len(of)} intervals hold")


if __name__ == "__main__":
    typer.run(main)
