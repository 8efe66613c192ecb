"""Collector of the columns of a batch of episodes."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from marl_airhockey.rollouts.columns import episode_notes, first_columns, step_columns
from marl_airhockey.sim.core.recording import Columns, Episode
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array


class Collector:
    """Collector of the columns of B episodes that are played in parallel.

    Args:
        world: Worlds whose episodes have begun.
        names: Names of the columns that are collected; None for all.
    """

    def __init__(self, world: World, names: Collection[str] | None = None) -> None:
        self._world, self._names = world, names
        self._notes = [episode_notes(world, i) for i in range(world.num_worlds)]
        self.first = first_columns(world, names)
        """Columns (B, ...) before the first step."""
        self._rows: list[Columns] = []

    def add(self) -> None:
        """Collect the columns of the last step."""
        self._rows.append(step_columns(self._world, self._names))

    @property
    def steps(self) -> Columns:
        """Columns (B, T, ...) after each step."""
        rows = self._rows
        return {name: np.stack([row[name] for row in rows], 1) for name in rows[0]}

    def episodes(
        self, lengths: Array, reasons: Sequence[str], first_index: int = 0
    ) -> Iterator[Episode]:
        """Yield the first n episodes, as views of the collected arrays.

        Args:
            lengths: Number of steps of each episode (n,).
            reasons: Reason of the end of each episode.
            first_index: Index of the first episode.
        """
        steps = self.steps
        for i, (length, reason) in enumerate(zip(lengths, reasons, strict=True)):
            yield Episode(
                first_index + i,
                *self._notes[i],
                reason,
                {name: value[i] for name, value in self.first.items()},
                {name: value[i, :length] for name, value in steps.items()},
            )
