"""Folder of a training run: its progress, evaluations, best and last policy."""

from __future__ import annotations

import csv
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.run_config import RunConfig

if TYPE_CHECKING:
    from marl_airhockey.learn.logs import Log

ProgressCallback = Callable[[int, int, Metrics], None]
"""Function that is called with the finished steps, all steps, and the latest
evaluation."""


Config = TypeVar("Config", bound=RunConfig, covariant=True)


@dataclass
class Progress:
    """Progress of a run, the content of ``state.json``."""

    steps: int = 0
    learning_cpu_seconds: float = 0.0
    """CPU time of rollouts and updates, including that of other processes, s."""
    evaluation_cpu_seconds: float = 0.0
    """CPU time of evaluations and of writing policies, s."""
    setup_cpu_seconds: float = 0.0
    """CPU time before the first step, for compilation and construction of worlds and
    networks, s."""
    wall_seconds: float = 0.0
    rate: float = 0.0
    start_spread: float = 0.0
    """Share of the ranges of starts in a curriculum; 0 before its beginning."""
    best: tuple[float, float] = (-1.0, float("-inf"))
    """First metric and return of the best evaluation."""

    @property
    def cpu_seconds(self) -> float:
        """Total CPU time, s."""
        return sum(self.cpu_times.values())

    @property
    def cpu_times(self) -> dict[str, float]:
        """CPU times by the names of their fields, s."""
        fields = vars(self)
        return {name: fields[name] for name in fields if name.endswith("_cpu_seconds")}

    def save(self, path: Path) -> None:
        """Write the file atomically: a killed process leaves the old or the new one."""
        draft = path.with_suffix(".part")
        draft.write_text(json.dumps({"cpu_seconds": self.cpu_seconds, **vars(self)}))
        draft.replace(path)

    @staticmethod
    def load(path: Path) -> Progress:
        """Read a file that `save` wrote.

        Raises:
            ValueError: The file is damaged. The message names it.
        """
        try:
            data = json.loads(path.read_text())
            data.pop("cpu_seconds")  # The sum of the other times.
            return Progress(**{**data, "best": tuple(data["best"])})
        except (KeyError, TypeError, ValueError) as error:
            raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> ValueError:
    return ValueError(
        f"{path} is damaged ({error}); begin the run again in another folder"
    )


class TrainingRun(Generic[Config]):
    """Folder of a run, which every engine updates.

    Args:
        config: Configuration of the run.
        folder: Folder of the run. A run that exists in it is resumed.
        report: Function that is called during training.
    """

    def __init__(
        self, config: Config, folder: Path, report: ProgressCallback | None = None
    ) -> None:
        self.config, self.folder, self._report = config, folder, report
        state = folder / "state.json"
        self.progress = Progress.load(state) if state.exists() else Progress()
        self.latest: Metrics = {}
        """Last row of ``evaluations.csv``."""
        self._every = max(config.total_steps // config.evaluations, 1)
        self._next = (self.progress.steps // self._every + 1) * self._every
        self._table = folder / "evaluations.csv"
        if self._table.exists():
            try:
                with self._table.open() as file:
                    *rows, last = csv.DictReader(file)
                self.latest = {name: float(value) for name, value in last.items()}
            except (TypeError, ValueError) as error:
                raise _damaged(self._table, error) from error
            if not state.exists():
                if rows:
                    raise _damaged(state, FileNotFoundError("it is missing"))
                self._table.unlink()  # The process was killed in its first evaluation.
                self.latest = {}
        self._clock = (time.process_time(), time.perf_counter())

    @property
    def steps_left(self) -> int:
        """Number of steps that are left."""
        return self.config.total_steps - self.progress.steps

    def train(
        self,
        advance: Callable[[], tuple[int, float]],
        evaluate: Callable[[], Metrics],
        log: Log,
    ) -> Metrics:
        """Train to the end of the run; return the last evaluation.

        Args:
            advance: Function that learns for some steps. It returns the number of steps
                since the beginning of the run, and the learning rate.
            evaluate: Function that evaluates and saves the policy, see
                `record_evaluation`. It returns the row of the evaluation.
            log: Log of the run, which is closed at the end.
        """
        row = self.latest
        try:
            while self.steps_left > 0:
                steps, rate = advance()
                self._update_progress(steps, rate)
                if steps >= self._next or self.steps_left <= 0:
                    row = evaluate()
                log.dump(steps)
        finally:
            log.close()
        return row

    def end_setup(self) -> None:
        """Count the time so far as setup, and the following time as learning."""
        self.progress.setup_cpu_seconds += self._cpu_seconds()

    def _cpu_seconds(self) -> float:
        """Return the CPU time since the last call, and add the wall time to the run."""
        began = self._clock
        self._clock = (time.process_time(), time.perf_counter())
        self.progress.wall_seconds += self._clock[1] - began[1]
        return self._clock[0] - began[0]

    def _update_progress(self, steps: int, rate: float) -> None:
        """Set the number of steps, and count the time since the last call as learning.

        Args:
            steps: Number of steps since the beginning of the run.
            rate: Current learning rate, with which a resumed run continues.
        """
        progress = self.progress
        progress.learning_cpu_seconds += self._cpu_seconds()
        progress.steps, progress.rate = steps, rate
        if self._report is not None:
            self._report(steps, self.config.total_steps, self.latest)

    def record_evaluation(
        self, metrics: Metrics, save: Callable[[str], None]
    ) -> Metrics:
        """Add a row to ``evaluations.csv``, save policy and progress; return the row.

        The time since the last step counts as evaluation.

        Args:
            metrics: Evaluation of the current policy.
            save: Function that saves the policy under a name, "best" or "last".
        """
        progress = self.progress
        progress.evaluation_cpu_seconds += self._cpu_seconds()
        clock = {
            "steps": progress.steps,
            "cpu_seconds": progress.cpu_seconds,
            **progress.cpu_times,
            "wall_seconds": progress.wall_seconds,
        }
        self.latest = {**clock, **metrics}
        self._write(self.latest)
        score = (next(iter(metrics.values())), metrics["return"])
        if score > tuple(progress.best):
            progress.best = score
            save("best")
        save("last")
        progress.evaluation_cpu_seconds += self._cpu_seconds()
        progress.save(self.folder / "state.json")
        self._next = (progress.steps // self._every + 1) * self._every
        return self.latest

    def _write(self, row: Metrics) -> None:
        """Add a row to the table, so that a killed process leaves whole rows."""
        fresh, draft = not self._table.exists(), self._table.with_suffix(".part")
        if not fresh:
            shutil.copyfile(self._table, draft)
        with draft.open("a", newline="") as file:
            writer = csv.DictWriter(file, list(row))
            if fresh:
                writer.writeheader()
            writer.writerow(row)
        draft.replace(self._table)

    @property
    def checkpoint_path(self) -> Path:
        """Path of the checkpoint at the current steps; its folder is created."""
        folder = self.folder / "checkpoints"
        folder.mkdir(exist_ok=True)
        return folder / f"{self.progress.steps:012d}.npz"
