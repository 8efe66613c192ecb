"""Parts of a recording: its files of steps, in order."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.data.parquet import SETTINGS, read_table
from marl_airhockey.sim.core.recording import STEPS

ROWS = 65_536
"""Least number of steps in a row group, except for the last one."""


def part_path(recording: Path, number: int) -> Path:
    """Return the path of a part."""
    return recording / STEPS / f"part-{number:05d}.parquet"


def parts_of(recording: Path) -> list[Path]:
    """Return the parts of a recording, in order."""
    return sorted((recording / STEPS).glob("part-*.parquet"))


def merge_parts(recording: Path) -> None:
    """Replace the parts of a recording by one part.

    The merged part replaces the first one, then the others are deleted. After an
    interruption, the others repeat steps of the merged part. `reader` skips them.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = parts_of(recording)
    if len(parts) < 2:
        return
    draft = parts[0].with_name(f"{parts[0].name}.part")
    writer, waiting, count = None, [], 0
    try:
        for path in parts:
            waiting.append(read_table(path))
            count += len(waiting[-1])
            if writer is None:
                writer = pq.ParquetWriter(draft, waiting[0].schema, **SETTINGS)
            if count >= ROWS or path == parts[-1]:
                writer.write_table(pa.concat_tables(waiting))
                waiting, count = [], 0
    finally:
        if writer is not None:
            writer.close()
    draft.replace(parts[0])
    for path in parts[1:]:
        path.unlink()
