"""Progress of long operations: a bar in a terminal, else a line every ten seconds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from marl_airhockey.sim.jit.notices import repeated

errors = Console(stderr=True)
"""Console of messages that are not results; output can still be piped."""


@dataclass
class Lines:
    """Progress of one task as lines of text, with the methods of ``rich.Progress``."""

    description: str = ""
    total: float | None = None
    completed: float = 0.0
    note: str = ""
    began: float = 0.0

    def add_task(self, description: str, total: float | None, note: str = "") -> TaskID:
        """Start the task and its clock."""
        self.description, self.total, self.note = description, total, note
        self.began = time.monotonic()
        return TaskID(0)

    def update(
        self,
        task: TaskID,
        *,
        completed: float | None = None,
        total: float | None = None,
        note: str | None = None,
        advance: float = 0.0,
    ) -> None:
        """Update the values that are given."""
        self.completed = self.completed if completed is None else completed
        self.completed += advance
        self.total = self.total if total is None else total
        self.note = self.note if note is None else note

    def advance(self, task: TaskID, advance: float = 1.0) -> None:
        """Add to the completed amount."""
        self.completed += advance

    @property
    def line(self) -> str:
        """Line with the elapsed time, the completed share and the time left."""
        spent = time.monotonic() - self.began
        parts = [f"{self.description}: {spent:.0f} s so far"]
        if self.total and self.completed:
            share = min(self.completed / self.total, 1.0)
            parts += [f"{share:.0%}", f"about {spent / share - spent:.0f} s left"]
        return ", ".join([*parts, self.note] if self.note else parts)


@contextmanager
def bar() -> Iterator[Progress | Lines]:
    """Show progress on standard error: a bar, or lines if it is not a terminal."""
    if errors.is_terminal:
        with Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}"),
            console=errors,
        ) as progress:
            yield progress
        return
    lines = Lines()
    with repeated(partial(_print, lines)):
        yield lines
    _print(lines)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Show a message during a long operation whose progress is unknown."""
    if errors.is_terminal:
        with errors.status(what):
            yield
        return
    lines = Lines(what, began=time.monotonic())
    with repeated(partial(_print, lines)):
        yield


def _print(lines: Lines) -> None:
    """Print the line of a task, if it has started."""
    if lines.description:
        errors.print(lines.line, markup=False, highlight=False, soft_wrap=True)
