"""Conversion of columns of NumPy arrays to Parquet tables, and back."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.recording import Column, Columns
from marl_airhockey.types import Array

if TYPE_CHECKING:
    import pyarrow as pa

EXTRA = "data"
"""Extra that installs pyarrow."""
SETTINGS: dict[str, Any] = {"compression": "zstd", "write_page_checksum": True}
"""Settings of all Parquet files."""
KEYS = ("episode", "step")
"""Columns with the numbers of episode and step of a row."""


def table_of(episode: Array, step: Array, columns: Columns) -> pa.Table:
    """Return a table of n steps.

    Args:
        episode: Number of the episode of each step (n,).
        step: Number of each step in its episode (n,).
        columns: Arrays (n, ...) by name.
    """
    require("pyarrow", EXTRA)
    import pyarrow as pa

    arrays = {"episode": pa.array(episode), "step": pa.array(step)}
    for name, values in columns.items():
        flat = pa.array(np.ascontiguousarray(values).reshape(-1))
        size = int(np.prod(values.shape[1:], dtype=np.int64))
        if values.ndim == 1:
            arrays[name] = flat
        elif size:  # Parquet has no lists of length 0.
            arrays[name] = pa.FixedSizeListArray.from_arrays(flat, size)
    return pa.table(arrays)


def warm_up() -> None:
    """Run the first calls of pyarrow, which are slow."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    number = np.zeros(1, np.int32)
    table = table_of(number, number, {"value": np.zeros((1, 2))})
    pq.write_table(table, pa.BufferOutputStream(), **SETTINGS)
    pa.Table.from_pylist([{"episode": 0, "reason": "", "returns": [0.0]}])


def columns_of(table: pa.Table, layout: Mapping[str, Column]) -> Columns:
    """Return columns (n, ...) of a table of n steps.

    Raises:
        ValueError: A column is missing, or does not match its description.
    """
    return {name: _values(table, name, column) for name, column in layout.items()}


def _values(table: pa.Table, name: str, column: Column) -> Array:
    import pyarrow as pa

    rows = len(table)
    if not column.size:
        return np.zeros((rows, *column.shape), column.dtype)
    if name not in table.column_names:
        raise ValueError(f"column {name} is missing")
    found = table[name].combine_chunks()
    size = 1
    if isinstance(found, pa.FixedSizeListArray):
        size, nulls = found.type.list_size, found.null_count
        found = found.flatten()
        if nulls:
            raise ValueError(f"column {name}: values are missing")
    kind = found.type
    if not (pa.types.is_primitive(kind) and found.null_count == 0):
        raise ValueError(f"column {name}: type {kind}, or missing values")
    values = found.to_numpy(zero_copy_only=False)
    if values.dtype != np.dtype(column.dtype) or size != column.size:
        raise ValueError(
            f"column {name}: {size} numbers of {values.dtype} per step, expected "
            f"{column.size} of {column.dtype}"
        )
    # Copy the values, because arrays of pyarrow are read-only.
    return np.array(values).reshape(rows, *column.shape)


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table to a file atomically: a failed write leaves no partial file.

    Args:
        table: Table to write.
        path: Path of the file, which may exist.

    Raises:
        OSError: The disk is full, or the folder cannot be written.
    """
    import pyarrow.parquet as pq

    draft = path.with_name(f"{path.name}.part")
    try:
        with draft.open("wb") as file:
            pq.write_table(table, file, **SETTINGS)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def read_table(path: Path, names: Iterable[str] | None = None) -> pa.Table:
    """Read a table, or some of its columns; names without a column are ignored.

    Raises:
        ValueError: The file does not exist, or is not a Parquet file.
    """
    require("pyarrow", EXTRA)
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        # pyarrow.parquet.read_table would also inspect the folder.
        file = pq.ParquetFile(path, page_checksum_verification=True)
        known = file.schema_arrow.names
        wanted = None if names is None else [n for n in names if n in known]
        with file:
            table = file.read(wanted, use_threads=False)
        table.validate(full=True)
    except (OSError, ValueError, pa.ArrowException) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"{path}: cannot be read as parquet: {text}") from error
    return table
