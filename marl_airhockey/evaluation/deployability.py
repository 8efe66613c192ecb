"""Deployability: a summary of a driver's fitness for a real arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Deployability:
    """Fitness of a driver for a real arm, summed up in a grade.

    * A: violations in at most 1 of 100 control steps, at most 10 % of the power above
      5 Hz, decisions within 5 ms.
    * B: at most 1 of 10, 25 %, 10 ms.
    * C: at most 1 of 2, 50 %, 25 ms.
    * D: all others.
    """

    violations_per_minute: float
    """Control steps per minute in which the action exceeded the limits of speed,
    acceleration, jerk or reach"""
    jerk: float
    """Root mean square of the commands' jerk, m/s3"""
    power_above_5hz: float
    """Share of the actions' power above 5 Hz; nan for control below 10 Hz"""
    act_ms: float
    """Median CPU time of a decision for one world, ms; nan of a recording"""
    grade: str
    """A, B, C or D"""

    @staticmethod
    def of(
        violations: float, jerk: float, power: float, act_ms: float, control_dt: float
    ) -> Deployability:
        """Sum the measures up in a grade.

        Args:
            violations: share of the control steps with a violation.
            jerk: see `jerk`.
            power: see `power_above_5hz`.
            act_ms: see `act_ms`.
            control_dt: length of a control step, s.
        """
        bounds = {"A": (0.01, 0.10, 5.0), "B": (0.1, 0.25, 10.0), "C": (0.5, 0.5, 25.0)}
        high, act = np.nan_to_num([power, act_ms])
        grade = next(
            (
                name
                for name, (v, p, ms) in bounds.items()
                if violations <= v and high <= p and act <= ms
            ),
            "D",
        )
        per_minute = violations * 60 / control_dt
        return Deployability(per_minute, jerk, power, act_ms, grade)
