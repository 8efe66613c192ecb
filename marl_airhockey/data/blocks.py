"""Blocks of steps in memory, and the tables that are written from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from marl_airhockey.data.parquet import table_of, write_table
from marl_airhockey.data.parts import part_path
from marl_airhockey.sim.core.recording import EPISODES, Columns

if TYPE_CHECKING:
    import pyarrow as pa


class PendingSteps(NamedTuple):
    """Steps that are not written yet."""

    episode: int
    first: int
    """Number of the first step in its episode."""
    size: int
    """Number of steps."""
    rows: Columns


def step_table(blocks: Sequence[PendingSteps], names: Iterable[str]) -> pa.Table:
    """Return the table of the steps of some blocks.

    Args:
        blocks: Blocks of steps, in order.
        names: Names of the columns.
    """
    sizes = [block.size for block in blocks]
    steps = [np.arange(b.first, b.first + b.size, dtype=np.int32) for b in blocks]
    return table_of(
        np.repeat(np.array([b.episode for b in blocks], np.int32), sizes),
        np.concatenate(steps),
        {n: np.concatenate([b.rows[n] for b in blocks]) for n in names},
    )


def episode_table(episodes: Sequence[dict[str, Any]]) -> pa.Table:
    """Return the table of episodes.

    Args:
        episodes: Rows of the table.
    """
    import pyarrow as pa

    kinds = {"episode": pa.int32(), "seed": pa.uint64(), "number": pa.int64()}
    kinds |= {"length": pa.int64(), "reason": pa.string()}
    kinds |= dict.fromkeys(("returns", "success"), pa.list_(pa.float64()))
    names = list(dict.fromkeys(name for row in episodes for name in row))
    fields = [(name, kinds.get(name, pa.float64())) for name in names]
    return pa.Table.from_pylist(episodes, pa.schema(fields))


class DiskWriter:
    """Thread that writes the files of a recording.

    Args:
        path: Folder of the recording.
        part: Number of the first part.
    """

    def __init__(self, path: Path, part: int) -> None:
        self.part = part
        """Number of the next part."""
        self._path, self._thread = path, ThreadPoolExecutor(1, "recorder")
        self._work: tuple[Future[None], int] | None = None

    def start(
        self,
        episodes: Sequence[dict[str, Any]],
        blocks: Sequence[PendingSteps],
        names: Iterable[str],
    ) -> None:
        """Start writing the table of episodes, if there are rows, and a part of steps.

        Args:
            episodes: Rows of the episodes.
            blocks: Steps of the part, in order.
            names: Names of the columns of steps.
        """
        work = self._thread.submit(self._write, episodes, blocks, [*names])
        self._work = work, len(blocks)

    def _write(
        self,
        episodes: Sequence[dict[str, Any]],
        blocks: Sequence[PendingSteps],
        names: Sequence[str],
    ) -> None:
        if episodes:
            write_table(episode_table(episodes), self._path / EPISODES)
        if blocks:
            write_table(step_table(blocks, names), part_path(self._path, self.part))

    def collect(self, wait: bool) -> int | None:
        """Return the number of blocks that were written; None if writing continues.

        Args:
            wait: True to wait for the thread.

        Raises:
            OSError: Writing failed, for example because the disk is full.
        """
        if self._work is None:
            return 0
        work, count = self._work
        if not (wait or work.done()):
            return None
        self._work = None
        work.result()
        self.part += bool(count)
        return count

    def close(self) -> None:
        """Stop the thread."""
        self._thread.shutdown()
