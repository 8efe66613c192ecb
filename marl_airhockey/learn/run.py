"""The folder of a run: where it stands, its evaluations, its best and last policy."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.grade import Grades

Report = Callable[[int, int, Grades], None]
"""Called with steps done, steps in all, and the newest evaluation."""


@dataclass
class Progress:
    """Where a run stands; ``state.json``."""

    steps: int = 0
    cpu_seconds: float = 0.0
    wall_seconds: float = 0.0
    rate: float = 0.0
    best: tuple[float, float] = (-1.0, float("-inf"))
    """Success and return of the best evaluation."""

    def save(self, path: Path) -> None:
        """Write it so that a kill leaves the old or the new one."""
        draft = path.with_suffix(".part")
        draft.write_text(json.dumps(self.__dict__))
        draft.replace(path)

    @staticmethod
    def load(path: Path) -> Progress:
        """Read it."""
        data = json.loads(path.read_text())
        return Progress(**{**data, "best": tuple(data["best"])})


class Ledger:
    """Keeps the folder of a run up to date, whatever engine trains.

    Args:
        config: of the run.
        folder: of the run.
        report: called as training goes on.
    """

    def __init__(
        self, config: TrainConfig, folder: Path, report: Report | None = None
    ) -> None:
        self.config, self.folder, self._report = config, folder, report
        state = folder / "state.json"
        self.progress = Progress.load(state) if state.exists() else Progress()
        self.row: Grades = {}
        self._every = max(config.total_steps // config.evaluations, 1)
        self._next = (self.progress.steps // self._every + 1) * self._every
        self._table = folder / "evaluations.csv"
        if self._table.exists():
            with self._table.open() as file:
                *_, last = csv.DictReader(file)
            self.row = {name: float(value) for name, value in last.items()}
        self._start_clock()

    @property
    def left(self) -> int:
        """Steps that are still to be made."""
        return self.config.total_steps - self.progress.steps

    @property
    def due(self) -> bool:
        """Whether it is time for an evaluation."""
        return self.progress.steps >= self._next

    def _start_clock(self) -> None:
        self._clock = (time.process_time(), time.perf_counter())

    def account(self, steps: int, rate: float, elsewhere: float = 0.0) -> None:
        """Note steps done so far and the time they took; report it.

        Args:
            steps: from the beginning of the run.
            rate: of learning, to go on with.
            elsewhere: CPU time of other processes since the last call, s.
        """
        progress, began = self.progress, self._clock
        self._start_clock()
        progress.cpu_seconds += self._clock[0] - began[0] + elsewhere
        progress.wall_seconds += self._clock[1] - began[1]
        progress.steps, progress.rate = steps, rate
        if self._report is not None:
            self._report(steps, self.config.total_steps, self.row)

    def record(self, grades: Grades, save: Callable[[str], None]) -> Grades:
        """Add an evaluation, keep the policy, and save where the run stands.

        The time since the last `account` does not count as training.

        Args:
            grades: of the policy as it is.
            save: writes the policy under a name, "best" or "last".
        """
        progress = self.progress
        clock = {
            "steps": progress.steps,
            "cpu_seconds": progress.cpu_seconds,
            "wall_seconds": progress.wall_seconds,
        }
        self.row = {**clock, **grades}
        fresh = not self._table.exists()
        with self._table.open("a", newline="") as file:
            writer = csv.DictWriter(file, list(self.row))
            if fresh:
                writer.writeheader()
            writer.writerow(self.row)
        score = (next(iter(grades.values())), grades["return"])
        if score > tuple(progress.best):
            progress.best = score
            save("best")
        save("last")
        progress.save(self.folder / "state.json")
        self._next = (progress.steps // self._every + 1) * self._every
        self._start_clock()
        return self.row

    @property
    def milestone(self) -> Path:
        """Where the policy of now is kept beside earlier ones."""
        past = self.folder / "milestones"
        past.mkdir(exist_ok=True)
        return past / f"{self.progress.steps:012d}.npz"
