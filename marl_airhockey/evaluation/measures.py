"""Measures of played or recorded episodes, for the first seat."""

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
"""Columns of an episode that are needed. Only some scenarios have the last one."""
HIGH = 5.0
"""Frequency above which the power of the actions is a load on an arm, Hz."""


@dataclass(frozen=True)
class EpisodeMeasures:
    """Measures of an episode of T control steps."""

    success: bool
    """True for a success; False if a real table ended the episode early."""
    first_shot: bool
    """True if the episode succeeded before a second distinct touch."""
    returns: float
    length: int
    """Number of control steps, T."""
    touches: float
    """Number of distinct touches."""
    violations: int
    """Number of control steps in which the action exceeded a limit."""
    jerk: Array
    """Jerk of the commands, m/s3, (T, 2)."""
    actions: Array
    """Actions after their latency, divided by the top speed, (T, 2)."""
    interruption: str
    """Reason why the episode was not played to its end; "" if it was."""


def measure(episode: Episode, control_dt: float) -> EpisodeMeasures:
    """Measure an episode.

    Args:
        episode: Episode with the `COLUMNS`, of at least one step.
        control_dt: Length of a control step, s.
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
        episodes: Episodes with the `COLUMNS`. Episodes without steps are skipped.
        control_dt: Length of a control step, s.
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
        """Number of interrupted episodes by the reason of the interruption."""
        self._violations = sum(e.violations for e in found)
        self._jerk = [e.jerk for e in found]
        self._actions = [e.actions for e in found]

    @property
    def violations(self) -> float:
        """Share of the control steps in which the action exceeded a limit."""
        return float(self._violations / max(self.length.sum(), 1))

    @property
    def jerk(self) -> float:
        """Root mean square of the jerk of the commands, m/s3."""
        return float(np.sqrt((np.concatenate(self._jerk) ** 2).mean()))

    @property
    def high_power(self) -> float:
        """Share of the power of the actions above `HIGH`.

        It is nan unless half of the control rate is above `HIGH`.
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
