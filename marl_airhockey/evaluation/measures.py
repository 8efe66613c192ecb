"""Measures of episodes that were played or recorded, for the first seat."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from marl_airhockey.sim.core.recording import PLAYED, Episode
from marl_airhockey.types import Array

COLUMNS = (
    *("delayed_action", "command", "violation", "returns", "success"),
    "memory.touches",
)
"""Columns of an episode that are needed; touches only where the scenario has them"""
HIGH = 5.0
"""Frequency above which the power of actions is a strain on an arm, Hz"""


@dataclass(frozen=True)
class EpisodeMeasures:
    """Measures of an episode of T control steps."""

    success: bool
    """Whether it succeeded; False if a real table had to end it"""
    first_shot: bool
    """Whether it succeeded before a second distinct touch"""
    returns: float
    length: int
    """Number of control steps, T"""
    touches: float
    """Number of distinct touches"""
    violations: int
    """Number of control steps in which the action exceeded a limit"""
    jerk: Array
    """(T, 2) jerk of the commands, m/s3"""
    actions: Array
    """(T, 2) actions after their delay, fractions of top speed"""
    interruption: str
    """Reason for which it was not played to its end; "" for none"""


def measure(episode: Episode, control_dt: float) -> EpisodeMeasures:
    """Measure an episode.

    Args:
        episode: Episode with the `COLUMNS`, of at least one step.
        control_dt: Time of a step, s.
    """
    columns = episode.columns
    success = columns["success"].reshape(len(episode), -1) > 0
    touches = columns.get("memory.touches", np.zeros((len(episode), 1)))
    touches = touches.reshape(len(episode), -1).sum(-1)
    first_shot = False
    if "memory.touches" in columns and success.any():
        first_shot = bool(touches[success.any(-1).argmax()] <= 1)
    command = columns["command"][:, 0]
    acceleration = np.diff(command, axis=0, prepend=0.0) / control_dt
    interruption = ""
    if episode.reason != PLAYED:
        interruption = episode.reason or "the recording ends here"
    return EpisodeMeasures(
        success=bool(success[-1, 0]) and not interruption,
        first_shot=first_shot and not interruption,
        returns=float(columns["returns"][-1, 0]),
        length=len(episode),
        touches=float(touches[-1]),
        violations=int((columns["violation"][:, 0, -1] > 0).sum()),
        jerk=np.diff(acceleration, axis=0, prepend=0.0) / control_dt,
        actions=columns["delayed_action"][:, 0],
        interruption=interruption,
    )


class EpisodeStatistics:
    """Statistics of n episodes.

    Args:
        episodes: Episodes with the `COLUMNS`; those without steps are left out.
        control_dt: Time of a step, s.
    """

    def __init__(self, episodes: Iterable[Episode], control_dt: float) -> None:
        self._dt = control_dt
        found = [measure(e, control_dt) for e in episodes if len(e)]
        self.success = np.array([e.success for e in found], np.bool_)
        self.first_shot = np.array([e.first_shot for e in found], np.bool_)
        self.returns = np.array([e.returns for e in found])
        self.length = np.array([e.length for e in found])
        self.touches = np.array([e.touches for e in found])
        self.interrupted = np.array([bool(e.interruption) for e in found])
        self.interruptions = Counter(e.interruption for e in found if e.interruption)
        """Reasons for which episodes were not played to their end, and their number"""
        self._violations = sum(e.violations for e in found)
        self._jerk = [e.jerk for e in found]
        self._actions = [e.actions for e in found]

    @property
    def violations(self) -> float:
        """Share of the control steps in which the action exceeded a limit."""
        return float(self._violations / max(self.length.sum(), 1))

    @property
    def jerk(self) -> float:
        """Root mean square of the commands' jerk, m/s3."""
        return float(np.sqrt((np.concatenate(self._jerk) ** 2).mean()))

    @property
    def high_power(self) -> float:
        """Share of the actions' power above `HIGH`.

        It is nan if that is not below half of the control rate.
        """
        if 0.5 / self._dt <= HIGH:
            return float("nan")
        high = total = 0.0
        for series in self._actions:
            if len(series) < 8:
                continue
            power = np.abs(np.fft.rfft(series - series.mean(0), axis=0)) ** 2
            above = np.fft.rfftfreq(len(series), self._dt) > HIGH
            high, total = high + power[above].sum(), total + power.sum()
        return float(high / total) if total > 0 else 0.0
