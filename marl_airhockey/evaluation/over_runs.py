"""Success of several training runs that differ by their seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from marl_airhockey.evaluation.evaluate import EvaluationResult
from marl_airhockey.evaluation.stats import bootstrap, interval


@dataclass(frozen=True)
class OverRuns:
    """Mean success of some runs, with an interval over runs and one over episodes."""

    runs: int
    """Number of runs."""
    success: float
    """Mean success."""
    over_runs: tuple[float, float]
    """95 % interval over the runs, by bootstrap. It shows the variation between
    trainings."""
    over_episodes: tuple[float, float]
    """95 % interval over all episodes (Wilson). It shows the precision for these
    runs."""

    @staticmethod
    def of(results: Sequence[EvaluationResult]) -> OverRuns:
        """Summarize the results of some runs with the same number of episodes."""
        success = np.array([result.success for result in results])
        episodes = sum(result.episodes for result in results)
        mean = float(success.mean())
        spread = bootstrap(success, lambda values: float(values.mean()))
        return OverRuns(len(results), mean, spread, interval(mean, episodes))

    @property
    def text(self) -> str:
        """One line with the success and both intervals."""
        (a, b), (c, d) = self.over_runs, self.over_episodes
        return (
            f"success of {self.runs} runs: {self.success:.3f}, 95 % over runs "
            f"{a:.3f} .. {b:.3f}, over episodes {c:.3f} .. {d:.3f}"
        )
